// The list of patient profiles.
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { moment } from '../lib/time.js';
import { counted } from '../lib/units.js';
import { documents } from '../net/requests.js';
import { TextField } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, number, Table } from '../ui/widgets.js';

export function ProfilesPage({ person }) {
  const load = useLoad((signal) => documents('profiles').all(signal), []);
  const [text, setText] = useState('');
  const edit = may(person.role, 'edit profiles');
  return html`
    <${Heading} title="Patient profiles">${
      edit && html`<a class="button main" href="#/profiles-new">New profile</a>`
    }<//>
    <form class="filters" role="search" aria-label="Profiles" onSubmit=${(event) => event.preventDefault()}>
      <${TextField} label="Find" type="search" value=${text} onValue=${setText} />
    </form>
    <${Loaded} load=${load}>${(all) => {
      const shown = all.filter((p) => `${p.name} ${p.id}`.toLowerCase().includes(text.trim().toLowerCase()));
      if (shown.length === 0)
        return html`<${Empty} title=${all.length ? 'No profile matches' : 'There are no profiles yet'}>${
          all.length ? 'Change the search above.' : 'Make one: layers of tissue, a target, hazards.'
        }<//>`;
      return html`<${Table}
        caption=${`${shown.length} of ${counted(all.length, 'profile')}`}
        head=${['Profile', 'Id', number('Revision'), 'Changed', 'By', 'More']}
      >${shown.map(
        (p) => html`<tr key=${p.id}>
          <th scope="row"><a href=${href(['profiles', p.id])}>${p.name}</a></th>
          <td>${p.id}</td>
          <td class="number">${p.revision}</td>
          <td>${moment(p.created_unix_ms)}</td>
          <td>${p.author}</td>
          <td>
            <a href=${href(['profiles', p.id, 'revisions'])} aria-label=${'Revisions of ' + p.name}>Revisions</a>
            ${
              edit &&
              html` · <a href=${href(['profiles-new'], { from: p.id })} aria-label=${'Make a copy of ' + p.name}>
                  Copy
                </a>`
            }
          </td>
        </tr>`,
      )}<//>`;
    }}<//>
  `;
}

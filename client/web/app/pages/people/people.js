// The people: a list with a filter, and a form to add one.
import { grantable, kRoles, may } from '../../lib/roles.js';
import { href } from '../../lib/routes.js';
import { shownOf, words } from '../../lib/units.js';
import { people } from '../../net/requests.js';
import { announce, Dialog, Empty, Heading, Loaded, Mark, Problem, Table, usePages } from '../../ui/widgets.js';
import { SelectField, TextField } from '../../ui/fields.js';
import { DraftBack, useDraft } from '../../ui/draft.js';
import { useAction, useDebounced } from '../../ui/hooks.js';
import { html, useState } from '../../ui/html.js';

export function AddPerson({ role, close, done }) {
  const [entry, setEntry, draft] = useDraft('person', { name: '', full_name: '', role: 'trainee' });
  const [password, setPassword] = useState('');
  const action = useAction();
  const field = (key) => ({
    value: entry[key],
    onValue: (value) => setEntry({ ...entry, [key]: value }),
    path: key,
    problems: action.error?.field ? [{ path: action.error.field, message: action.error.said }] : [],
  });
  const cancel = () => {
    draft.drop();
    close();
  };
  const save = async (event) => {
    event.preventDefault();
    if (!(await action.run(() => people.add(password ? { ...entry, password } : entry)))) return;
    draft.drop();
    done(entry.name);
  };
  return html`<${Dialog} title="Add a person" close=${close}>
    <form onSubmit=${save}>
      <${TextField}
        label="Name"
        help="for logging in, e.g. anna.bauer; it cannot be changed later"
        required
        autocapitalize="none"
        spellcheck="false"
        autocomplete="off"
        ...${field('name')}
      />
      <${TextField} label="Full name" autocomplete="off" ...${field('full_name')} />
      <${SelectField} label="Role" options=${grantable(role).map((r) => [r, words(r)])} ...${field('role')} />
      <${TextField}
        label="Password"
        type="password"
        autocomplete="new-password"
        help="optional for trainees: a station vouches for them"
        ...${field('password')}
        value=${password}
        onValue=${setPassword}
      />
      <${Problem} error=${action.error?.field ? null : action.error} />
      <${DraftBack} draft=${draft} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy}>Add</button>
        <button type="button" onClick=${cancel}>Cancel</button>
      </div>
    </form>
  <//>`;
}

export function PeoplePage({ person, query }) {
  const [adding, setAdding] = useState(false);
  const [text, setText] = useState(query.find ?? '');
  const [role, setRole] = useState('');
  const search = useDebounced(text.trim(), 300);
  const pages = usePages((page, signal) => people.page({ search, role, page }, signal), [search, role]);
  return html`
    <${Heading} title="People">${
      may(person.role, 'edit people') &&
      html`
        <a class="button" href="#/people/import">Import from CSV</a>
        <button type="button" class="main" onClick=${() => setAdding(true)}>Add a person</button>
      `
    }<//>
    <form class="filters" role="search" aria-label="People" onSubmit=${(event) => event.preventDefault()}>
      <${TextField} label="Find" type="search" value=${text} onValue=${setText} />
      <${SelectField}
        label="Role"
        value=${role}
        onValue=${setRole}
        options=${[['', 'All roles'], ...kRoles.map((r) => [r, words(r)])]}
      />
    </form>
    <${Loaded} load=${pages.load}>${() => {
      const shown = pages.items;
      if (shown.length === 0)
        return html`<${Empty} title="No one matches">${
          search || role ? 'Change the search above.' : 'Add a person, or import a class from a CSV file.'
        }<//>`;
      return html`<${Table}
        caption=${shownOf(shown.length, pages.first?.total, 'person', 'people')}
        head=${['Name', 'Full name', 'Role', 'Groups', 'State', 'Code', 'Studies']}
      >${shown.map(
        (p) => html`<tr key=${p.name}>
          <th scope="row"><a href=${href(['people', p.name])}>${p.name}</a></th>
          <td>${p.full_name}</td>
          <td>${words(p.role)}</td>
          <td>${p.groups.join(', ')}${p.more_groups ? ` and ${p.more_groups} more` : ''}</td>
          <td>${
            p.disabled
              ? html`<${Mark} kind="locked">disabled<//>`
              : p.has_password
                ? html`<${Mark} kind="good">active<//>`
                : html`<${Mark} kind="open">no password<//>`
          }</td>
          <td>${p.has_code ? html`<${Mark} kind="good">has one<//>` : html`<${Mark} kind="open">none<//>`}</td>
          <td>${
            p.consent?.given
              ? html`<${Mark} kind="good">consents<//>`
              : p.consent
                ? html`<${Mark} kind="locked">refuses<//>`
                : html`<${Mark} kind="open">not asked<//>`
          }</td>
        </tr>`,
      )}<//>${pages.button}`;
    }}<//>
    ${
      adding &&
      html`<${AddPerson}
        role=${person.role}
        close=${() => setAdding(false)}
        done=${(name) => {
          setAdding(false);
          announce(`${name} was added.`);
          pages.load.reload();
        }}
      />`
    }
  `;
}

// Who changed what, and when.
import { href } from '../lib/routes.js';
import { moment } from '../lib/time.js';
import { upkeep } from '../net/requests.js';
import { TextField } from '../ui/fields.js';
import { html, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, Table, usePages } from '../ui/widgets.js';

export function AuditPage({ query }) {
  const [filter, setFilter] = useState({ who: query.who ?? '', action: query.action ?? '' });
  const pages = usePages(
    (page, signal) => upkeep.audit({ who: query.who, action: query.action, page }, signal),
    [query.who, query.action],
  );
  const go = (event) => {
    event.preventDefault();
    location.hash = href(['audit'], { who: filter.who.trim(), action: filter.action.trim() });
  };
  const set = (key) => (value) => setFilter({ ...filter, [key]: value });
  return html`
    <${Heading} title="Audit" />
    <form class="filters" role="search" aria-label="Audit" onSubmit=${go}>
      <${TextField} label="Who" value=${filter.who} onValue=${set('who')} autocomplete="off" />
      <${TextField}
        label="Action"
        value=${filter.action}
        onValue=${set('action')}
        autocomplete="off"
        help="as in the list, e.g. profile import"
      />
      <div class="actions">
        <button type="submit">Filter</button>
        <a class="button" href="#/audit" onClick=${() => setFilter({ who: '', action: '' })}>Show all</a>
      </div>
    </form>
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`
            <${Empty} title="No entry matches">Change the filter above. Changes of data, exports and log-ins are listed here.<//>
            ${pages.button}
          `
        : html`
            <${Table}
              caption=${pages.caption('entry', 'entries')}
              head=${['When', 'Who', 'Action', 'Subject', 'Detail']}
            >${pages.items.map(
              (e) =>
                html`<tr key=${e.id}>
                  <td>${moment(e.unix_ms)}</td>
                  <th scope="row">${e.who}</th>
                  <td>${e.action}</td>
                  <td class="long">${e.subject}</td>
                  <td class="long">${e.detail}</td>
                </tr>`,
            )}<//>
            ${pages.button}
          `}<//>
  `;
}

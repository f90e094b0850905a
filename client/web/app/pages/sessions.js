// Sessions, newest first.
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { clock, moment } from '../lib/time.js';
import { words } from '../lib/units.js';
import { sessions } from '../net/lab.js';
import { TextField } from '../ui/fields.js';
import { html, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, number, Table } from '../ui/parts.js';
import { usePages } from '../ui/paged.js';

/** Whether all requirements of a score are met; null: there is no score, or nothing was required. */
export function verdict(score) {
  const judged = (score ?? []).filter((row) => typeof row.passed === 'boolean');
  return judged.length ? judged.every((row) => row.passed) : null;
}

/** Lists may come without scores: then there is no column for them. */
export const judged = (sessions) => sessions.some((s) => s.score);

export function Verdict({ passed }) {
  if (passed === true) return html`<${Mark} kind="good">passed<//>`;
  if (passed === false) return html`<${Mark} kind="bad">not passed<//>`;
  return html`<${Mark} kind="open">no verdict<//>`;
}

export function SessionsPage({ query, person }) {
  const staff = may(person.role, 'see results');
  const trainee = staff ? query.trainee : person.name;
  const [filter, setFilter] = useState({ trainee: query.trainee ?? '', exercise: query.exercise ?? '' });
  const pages = usePages((page, signal) => sessions.page({ trainee, exercise: query.exercise, page }, signal), [trainee, query.exercise]);
  const go = (event) => {
    event.preventDefault();
    location.hash = href(['sessions'], { trainee: filter.trainee.trim(), exercise: filter.exercise.trim() });
  };
  return html`<${Heading} title="Sessions" />
    <form class="filters" role="search" aria-label="Sessions" onSubmit=${go}>
      ${staff && html`<${TextField} label="Trainee" value=${filter.trainee} onValue=${(v) => setFilter({ ...filter, trainee: v })} autocomplete="off" />`}
      <${TextField} label="Exercise id" value=${filter.exercise} onValue=${(v) => setFilter({ ...filter, exercise: v })} autocomplete="off" />
      <div class="actions"><button type="submit">Find</button><a class="button" href="#/sessions">Show all</a></div></form>
    <${Loaded} load=${pages.load}>${() => (pages.items.length === 0
      ? html`<${Empty} title="There are no sessions here">They come from the stations: assign an exercise, and let somebody practise.<//>${pages.button}`
      : html`<${Table} caption=${`${pages.items.length} sessions, newest first`} head=${['Begun', 'Trainee', 'Exercise', 'Station', number('Length'), 'State', ...(judged(pages.items) ? ['Verdict'] : [])]}>
        ${pages.items.map((s) => html`<tr key=${s.description.session_id}><th scope="row"><a href=${href(['sessions', s.description.session_id])}>${moment(s.description.started_unix_ms)}</a></th>
          <td>${s.description.trainee}</td><td>${s.description.exercise_id}</td><td>${s.description.station}</td><td class="number">${s.description.rate_hz ? clock(s.samples / s.description.rate_hz) : '–'}</td>
          <td>${words(String(s.state).replace('SESSION_', ''))}</td>${judged(pages.items) && html`<td><${Verdict} passed=${verdict(s.score)} /></td>`}</tr>`)}<//>${pages.button}`)}<//>`;
}

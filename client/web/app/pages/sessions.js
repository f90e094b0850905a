// Sessions, newest first.
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { clock, moment } from '../lib/time.js';
import { words } from '../lib/units.js';
import { kVerdicts, verdictOf } from '../lib/verdict.js';
import { sessions } from '../net/requests.js';
import { SelectField, TextField } from '../ui/fields.js';
import { html, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, number, Table, usePages } from '../ui/widgets.js';

/** Midnight, local time, of a day as an input has it ("2026-12-01"), plus some days; '' stays ''. */
function midnight_ms(day, more = 0) {
  const [year, month, date] = day.split('-').map(Number);
  return day ? new Date(year, month - 1, date + more).getTime() : '';
}

/** passed: the verdict of the first score; absent if there is no score or no requirement. */
export function Verdict({ passed }) {
  const [kind, word] = verdictOf(passed);
  return html`<${Mark} kind=${kind}>${word}<//>`;
}

export function SessionsPage({ query, person }) {
  const staff = may(person.role, 'see results');
  const { exercise, search, verdict: wanted, from, to } = query;
  const trainee = staff ? query.trainee : person.name;
  const asked = {
    trainee,
    exercise,
    search: staff ? search : undefined,
    verdict: wanted,
    from_ms: midnight_ms(from ?? ''),
    to_ms: midnight_ms(to ?? '', 1),
  };
  const [filter, setFilter] = useState({
    search: search ?? query.trainee ?? '',
    exercise: exercise ?? '',
    verdict: wanted ?? '',
    from: from ?? '',
    to: to ?? '',
  });
  const pages = usePages((page, signal) => sessions.page({ ...asked, page }, signal), Object.values(asked));
  const change = (name) => (value) => setFilter({ ...filter, [name]: value });
  const go = (event) => {
    event.preventDefault();
    location.hash = href(['sessions'], {
      ...filter,
      search: staff ? filter.search.trim() : '',
      exercise: filter.exercise.trim(),
    });
  };
  return html`
    <${Heading} title="Sessions" />
    <form class="filters" role="search" aria-label="Sessions" onSubmit=${go}>
      ${
        staff &&
        html`<${TextField} label="Trainee" value=${filter.search} onValue=${change('search')} autocomplete="off" />`
      }
      <${TextField} label="Exercise id" value=${filter.exercise} onValue=${change('exercise')} autocomplete="off" />
      <${SelectField} label="Verdict" options=${[['', 'any'], ...kVerdicts]} value=${filter.verdict} onValue=${change('verdict')} />
      <${TextField} label="From" type="date" value=${filter.from} onValue=${change('from')} />
      <${TextField} label="To" type="date" value=${filter.to} onValue=${change('to')} />
      <div class="actions"><button type="submit">Find</button><a class="button" href="#/sessions">Show all</a></div>
    </form>
    ${may(person.role, 'assign sessions') && html`<p><a href="#/unknown-trainees">Sessions of unknown trainees</a></p>`}
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`
            <${Empty} title="There are no sessions here">
              They come from the stations: assign an exercise, and let somebody practise.
            <//>
            ${pages.button}
          `
        : html`
            <${Table}
              caption=${pages.caption('session')}
              head=${['Begun', 'Trainee', 'Exercise', 'Station', number('Length'), 'State', 'Verdict']}
            >${pages.items.map(
              (s) => html`<tr key=${s.description.session_id}>
                <th scope="row">
                  <a href=${href(['sessions', s.description.session_id])}>${moment(s.description.started_unix_ms)}</a>
                </th>
                <td>${s.description.trainee} ${s.unknown_trainee && html`<${Mark} kind="warn">${s.code_unchecked ? 'no code' : 'unknown'}<//>`}</td>
                <td>${s.description.exercise_id}</td>
                <td>${s.description.station}</td>
                <td class="number">${clock(s.samples / s.description.rate_hz)}</td>
                <td>
                  ${words(String(s.state).replace('SESSION_', ''))}
                  ${s.quarantined_chunks > 0 && html` <${Mark} kind="bad">damaged<//>`}
                </td>
                <td><${Verdict} passed=${s.passed} /></td>
              </tr>`,
            )}<//>
            ${pages.button}
          `}<//>
  `;
}

// Sessions, newest first.
import { traineeName } from '../lib/lab.js';
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { clock, moment } from '../lib/time.js';
import { words } from '../lib/units.js';
import { kVerdicts, verdictOf } from '../lib/verdict.js';
import { exercises, sessions } from '../net/requests.js';
import { SelectField, TextField } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, number, Table, usePages } from '../ui/widgets.js';

/** Midnight, local time, of a day as in an input ("2026-12-01"), plus some days; '' stays ''. */
function midnight_ms(day, more = 0) {
  const [year, month, date] = day.split('-').map(Number);
  return day ? new Date(year, month - 1, date + more).getTime() : '';
}

/** Why a session waits for a manager: in a word, and for a list. */
export function whyItWaits(session) {
  if (session.begin_unsure) return ['clock', 'the station’s clock was wrong'];
  if (session.not_assigned) return ['not assigned', 'it was not assigned'];
  return session.code_unchecked ? ['no code', 'the code was not given'] : ['unknown', 'no one had the name'];
}

/** For a session or attempt, the verdict of its first score; for an exam, when its result is shown. */
export function Verdict({ of }) {
  if (of.results_from_unix_ms) return html`<${Mark} kind="open">result from ${moment(of.results_from_unix_ms)}<//>`;
  const [kind, word] = verdictOf(of.passed);
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
  const known = useLoad((signal) => exercises(signal), []).data ?? [];
  const nameOf = (id) => known.find((e) => e.id === id)?.name || id;
  const change = (name) => (value) => setFilter({ ...filter, [name]: value });
  const go = (event) => {
    event.preventDefault();
    location.hash = href(['sessions'], {
      ...filter,
      search: staff ? filter.search.trim() : '',
    });
  };
  return html`
    <${Heading} title="Sessions" />
    <form class="filters" role="search" aria-label="Sessions" onSubmit=${go}>
      ${
        staff &&
        html`<${TextField} label="Trainee" value=${filter.search} onValue=${change('search')} autocomplete="off" />`
      }
      <${SelectField}
        label="Exercise"
        options=${[['', 'any'], ...known.map((e) => [e.id, e.name])]}
        value=${filter.exercise}
        onValue=${change('exercise')}
      />
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
              They come from the stations: assign an exercise, and let someone practise.
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
                <td>${traineeName(s.description)} ${s.unknown_trainee && html`<${Mark} kind="warn">${whyItWaits(s)[0]}<//>`}</td>
                <td>${nameOf(s.description.exercise_id)}</td>
                <td>${s.description.station}</td>
                <td class="number">${clock(s.samples / s.description.rate_hz)}</td>
                <td>
                  ${words(String(s.state).replace('SESSION_', ''))}
                  ${s.quarantined_chunks > 0 && html` <${Mark} kind="bad">damaged<//>`}
                </td>
                <td><${Verdict} of=${s} /></td>
              </tr>`,
            )}<//>
            ${pages.button}
          `}<//>
  `;
}

// Home: what matters today, by role. Each number leads to its list.
import { stationState } from '../lib/lab.js';
import { rowTitle } from '../lib/measures.js';
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { ago, day } from '../lib/time.js';
import { trendOfAll } from '../lib/verdict.js';
import { followLab } from '../net/live.js';
import { measures, people, sessions, today } from '../net/requests.js';
import { useExerciseName, useLoad } from '../ui/hooks.js';
import { html, useEffect, useState } from '../ui/html.js';
import { Heading, Loaded, Mark } from '../ui/widgets.js';
import { nextOf, ownCourses } from './mine.js';

/** A number with what it counts; `urgent`: it stands out unless it is 0. */
function Figure({ value, words, to, urgent }) {
  const inside = html`<strong class=${'figure' + (urgent && value ? ' figure-urgent' : '')}>${value}</strong> ${words}`;
  return html`<li class="tile">${to ? html`<a class="figure-link" href=${to}>${inside}</a>` : html`<span>${inside}</span>`}</li>`;
}

/** How many stations are in each state (lib/lab.js), by the live line; null until it has said so. */
function useStations() {
  const [counts, setCounts] = useState(null);
  useEffect(() => {
    const follower = followLab(
      (tiles) => {
        const now = { practising: 0, idle: 0, trouble: 0, offline: 0 };
        for (const tile of tiles) now[stationState(tile)]++;
        setCounts((before) => (JSON.stringify(before) === JSON.stringify(now) ? before : now));
      },
      () => {},
    );
    return () => follower.stop();
  }, []);
  return counts;
}

const plural = (n, one, many) => (n === 1 ? one : many);

function Staff({ person }) {
  const load = useLoad((signal) => today(undefined, undefined, signal), []);
  const stations = useStations();
  return html`<${Loaded} load=${load}>${(now) => {
    const teaching = [
      html`<${Figure}
        value=${now.struggling}
        words="struggling: the same requirement failed three times in a row"
        to="#/today/struggling"
        urgent
      />`,
      stations && html`<${Figure} value=${stations.practising} words="practising now" to="#/live?show=practising" />`,
    ];
    const dates = [
      html`<${Figure}
        value=${now.behind}
        words=${plural(now.behind, 'trainee is behind', 'trainees are behind')}
        to="#/today/behind"
        urgent
      />`,
      html`<${Figure}
        value=${now.due}
        words=${plural(now.due, 'trainee has', 'trainees have') + ' something due this week'}
        to="#/today/due"
      />`,
    ];
    const managing = may(person.role, 'assign sessions') && [
      html`<${Figure}
        value=${now.waiting}
        words=${plural(now.waiting, 'session waits', 'sessions wait') + ' to be confirmed'}
        to="#/unknown-trainees"
        urgent
      />`,
      html`<${Figure}
        value=${now.backup_unix_ms ? ago(now.backup_unix_ms) : 'never'}
        words="the last verified backup"
        to=${may(person.role, 'upkeep') && '#/upkeep'}
      />`,
    ];
    const lab = stations && [
      html`<${Figure}
        value=${stations.trouble}
        words=${plural(stations.trouble, 'station', 'stations') + ' in trouble'}
        to="#/live?show=trouble"
        urgent
      />`,
      html`<${Figure} value=${stations.idle} words=${plural(stations.idle, 'station', 'stations') + ' idle'} to="#/live?show=idle" />`,
    ];
    const order = managing ? [dates, managing, teaching, lab] : [teaching, dates, lab];
    return html`<ul class="tiles">${order}</ul>`;
  }}<//>`;
}

/** The newest session that was not passed, with the titles of what it failed; null: there is none. */
async function lastFailure(person, signal) {
  const [session] = (await sessions.page({ trainee: person.name, verdict: 'failed', limit: 1 }, signal)).items;
  if (!session) return null;
  const { session_id, exercise_id } = session.description;
  const [score, kinds] = await Promise.all([sessions.score(session_id, signal), measures(signal)]);
  const rows = (score.measures ?? []).filter((row) => row.passed === false);
  return { session_id, exercise_id, titles: rows.map((row) => rowTitle(row, kinds)) };
}

/** The exercise that was tried last, and how all that it requires went; null: none was tried. */
async function ownTrend(person, signal) {
  const [last] = await people.tried(person.name, signal);
  if (!last) return null;
  const page = await people.attempts(person.name, last.exercise_id, '', signal);
  const scores = page.items.flatMap((attempt) => attempt.score ?? []);
  const required = scores.filter((row) => typeof row.passed === 'boolean').map((row) => row.measure);
  return { exercise_id: last.exercise_id, mark: trendOfAll(page.measures ?? [], required) };
}

function Trainee({ person }) {
  const load = useLoad(
    (signal) => Promise.all([ownCourses(person, signal), lastFailure(person, signal), ownTrend(person, signal)]),
    [person.name],
  );
  const nameOf = useExerciseName();
  return html`<${Loaded} load=${load}>${([courses, failure, trend]) => {
    const next = courses
      .map((row) => ({ exercise: nextOf(row), row }))
      .filter(({ exercise }) => exercise)
      .map(({ exercise, row }) => ({
        exercise,
        due: row.cells.find((c) => c.exercise_id === exercise.id)?.due_unix_ms,
      }))
      .sort((a, b) => (a.due || Infinity) - (b.due || Infinity))[0];
    return html`<ul class="tiles">
      <li class="tile">
        <h2>Next exercise</h2>
        <p>${
          next
            ? html`<a href="#/mine">${next.exercise.name}</a>${next.due ? `, due ${day(next.due)}` : ''}`
            : 'Nothing is left to do.'
        }</p>
      </li>
      <li class="tile">
        <h2>Failed last</h2>
        <p>${
          failure
            ? html`<a href=${href(['sessions', failure.session_id])}>${nameOf(failure.exercise_id)}</a>${
                failure.titles.length > 0 ? `: ${failure.titles.join(', ')}` : ''
              }`
            : 'Nothing yet.'
        }</p>
      </li>
      <li class="tile">
        <h2>How it goes</h2>
        <p>${
          trend
            ? html`<${Mark} kind=${trend.mark[0]}>${trend.mark[1]}<//> at <a
                  href=${href(['progress', person.name], { exercise: trend.exercise_id })}
                >${nameOf(trend.exercise_id)}</a>`
            : 'It shows after the first attempts.'
        }</p>
      </li>
    </ul>`;
  }}<//>`;
}

export function Home({ person }) {
  return html`
    <${Heading} title=${'Welcome, ' + (person.full_name || person.name)} />
    ${may(person.role, 'see results') && html`<${Staff} person=${person} />`}
    ${may(person.role, 'see own') && html`<${Trainee} person=${person} />`}
    ${may(person.role, 'export study') && !may(person.role, 'see results') && html`<p><a href="#/exports">Export a study</a></p>`}
    <p class="help">Press <kbd>?</kbd> for keyboard shortcuts.</p>
  `;
}

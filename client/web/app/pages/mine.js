// A trainee's own page: assigned, passed and next exercises.
import { nextDue, numbered } from '../lib/course_rules.js';
import { href } from '../lib/routes.js';
import { moment } from '../lib/time.js';
import { counted } from '../lib/units.js';
import { assignments, documents, exercises, results } from '../net/requests.js';
import { useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark } from '../ui/widgets.js';
import { Cell } from './results.js';

/** This person's own row of each course. */
export async function ownCourses(person, signal) {
  const [given, courses, all] = await Promise.all([
    assignments.of(person.name, signal),
    documents('courses').all(signal),
    exercises(signal),
  ]);
  // show a course if it or one of its exercises is assigned, or if it was tried
  const rows = await Promise.all(
    courses.map(async (course) => {
      const reply = await results({ course: course.id }, signal);
      const cells = reply.items.find((r) => r.trainee === person.name)?.cells ?? [];
      const mine = given.filter(
        (a) => a.course_id === course.id || reply.exercises.some((e) => e.id === a.exercise_id),
      );
      return {
        course,
        cells,
        given: mine,
        exercises: reply.exercises.map((e) => ({ ...all.find((x) => x.id === e.id), ...e })),
      };
    }),
  );
  return rows.filter((r) => r.given.length > 0 || r.cells.some((c) => c.attempts > 0));
}

/** The first exercise that the person may practise and has not passed; undefined: none is left. */
export function nextOf({ cells, exercises: list }) {
  return list.find((e) => {
    const c = cells.find((x) => x.exercise_id === e.id);
    const taken = c?.results_from_unix_ms && c.attempts > 0;
    return !c || (c.passed !== true && !taken && c.locked_by.length === 0 && c.attempts_left !== 0);
  });
}

function Course({ row, person }) {
  const { course, cells, exercises: list } = row;
  const due = nextDue(list, cells);
  const passed = cells.filter((c) => c.passed === true).length;
  const next = nextOf(row);
  const nameOf = (id) => list.find((e) => e.id === id)?.name ?? id;
  return html`<section aria-label=${course.name}>
    <h2>${course.name} ${course.exam && html`<${Mark} kind="info">exam<//>`}</h2>
    <p>
      ${
        passed === list.length
          ? html`<${Mark} kind="good">all passed<//>`
          : html`${passed} of ${counted(list.length, 'exercise')} passed.`
      } ${due && html`Next due ${moment(due)}.`} ${next && html`<strong>Next: ${next.name}.</strong>`}
    </p>
    <ol class="tiles">${list.map((e, i) => {
      const cell = cells.find((c) => c.exercise_id === e.id);
      return html`<li class="tile" key=${e.id}>
        <h3>${numbered(i, e.name)}</h3>
        ${e.description && html`<p class="help">${e.description}</p>`}
        <p>${
          cell
            ? html`<${Cell} cell=${cell} trainee=${person.name} nameOf=${nameOf} />`
            : html`<${Mark} kind="open">not started<//>`
        }</p>
      </li>`;
    })}</ol>
  </section>`;
}

export function MinePage({ person }) {
  const load = useLoad((signal) => ownCourses(person, signal), [person.name]);
  return html`
    <${Heading} title="My results">
      <a class="button" href=${href(['progress', person.name])}>My progress</a>
      <a class="button" href="#/sessions">My sessions</a>
    <//>
    <${Loaded} load=${load}>${(rows) =>
      rows.length === 0
        ? html`<${Empty} title="Nothing is assigned to you yet">
            Your instructor assigns a course; it then appears here, and you practise at a station.
          <//>`
        : rows.map((row) => html`<${Course} key=${row.course.id} row=${row} person=${person} />`)}<//>
  `;
}

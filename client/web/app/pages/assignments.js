// Assignments: people, their tasks and due dates.
import { traineeName } from '../lib/lab.js';
import { href } from '../lib/routes.js';
import { fromInput, moment } from '../lib/time.js';
import { assignments, documents, exercises, groups, people } from '../net/requests.js';
import { announce, DangerButton, Empty, Heading, Loaded, Mark, Problem, Table, usePages } from '../ui/widgets.js';
import { SelectField, TextField } from '../ui/fields.js';
import { SearchField } from '../ui/search_field.js';
import { DraftBack, useDraft } from '../ui/draft.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';

/** A choice such as "course:basics": its kind and its id. */
const chosen = (choice) => [choice.slice(0, choice.indexOf(':')), choice.slice(choice.indexOf(':') + 1)];
const kKeys = { course: 'course_id', exercise: 'exercise_id', group: 'group_id', person: 'trainee' };

/** Groups first, because most assignments are theirs. */
async function findWhom(text, signal) {
  const [some_groups, trainees] = await Promise.all([
    groups.find(text, signal),
    people.find(text, { role: 'trainee' }, signal),
  ]);
  return {
    options: [
      ...some_groups.options.map((o) => ({ key: `group:${o.key}`, text: `Group: ${o.text}` })),
      ...trainees.options.map((o) => ({ key: `person:${o.key}`, text: o.text })),
    ],
    more: some_groups.more || trainees.more,
  };
}

function AddAssignment({ all, done }) {
  const [entry, setEntry, draft] = useDraft('assignment', { what: '', whom: null, due: '' });
  const action = useAction();
  const set = (key) => (value) => setEntry({ ...entry, [key]: value });
  const save = async (event) => {
    event.preventDefault();
    const [what, what_id] = chosen(entry.what),
      [whom, whom_id] = chosen(entry.whom.key);
    const due_unix_ms = fromInput(entry.due);
    const body = { [kKeys[what]]: what_id, [kKeys[whom]]: whom_id, ...(due_unix_ms ? { due_unix_ms } : {}) };
    if (!(await action.run(() => assignments.add(body)))) return;
    const name = (what === 'course' ? all.courses : all.exercises).find(({ id }) => id === what_id)?.name ?? what_id;
    announce(`${name} was assigned to ${entry.whom.text.replace(/^Group: /, '')}.`);
    draft.discard();
    done();
  };
  const whats = [
    ['', 'Choose …'],
    ...all.courses.map((c) => [`course:${c.id}`, `Course: ${c.name}`]),
    ...all.exercises.map((e) => [`exercise:${e.id}`, `Exercise: ${e.name}`]),
  ];
  return html`<form onSubmit=${save}>
    <fieldset>
      <legend>Assign</legend>
      <${DraftBack} draft=${draft} />
      <div class="fields">
        <${SelectField} label="What" required value=${entry.what} options=${whats} onValue=${set('what')} />
        <${SearchField}
          label="Assign to"
          required
          chosen=${entry.whom}
          find=${findWhom}
          onChoose=${set('whom')}
          help="type part of the name of a group or trainee"
        />
        <${TextField}
          label="Due"
          type="datetime-local"
          value=${entry.due}
          onValue=${set('due')}
          help="optional"
        />
      </div>
      <${Problem} error=${action.error} />
      <div class="actions"><button type="submit" class="main" disabled=${action.busy}>Assign</button></div>
    </fieldset>
  </form>`;
}

export function AssignmentsPage() {
  const load = useLoad(async (signal) => {
    const [courses, all_exercises] = await Promise.all([documents('courses').all(signal), exercises(signal)]);
    return { courses, exercises: all_exercises };
  }, []);
  const pages = usePages((page, signal) => assignments.page(page, signal), []);
  const drop = async (id) => {
    await assignments.remove(id);
    announce('The assignment was withdrawn.');
    pages.load.reload();
  };
  return html`
    <${Heading} title="Assignments" />
    <${Loaded} load=${load}>${(all) => {
      const nameOf = (list, id) => list.find((x) => x.id === id)?.name ?? id;
      const whatName = (a) => (a.course_id ? nameOf(all.courses, a.course_id) : nameOf(all.exercises, a.exercise_id));
      const whomName = (a) => (a.group_id ? a.group_name || a.group_id : traineeName(a));
      const what = (a) =>
        a.course_id ? html`<a href=${href(['courses', a.course_id])}>${whatName(a)}</a>` : whatName(a);
      const whom = (a) =>
        a.group_id
          ? html`<a href=${href(['groups', a.group_id])}>${whomName(a)}</a>`
          : html`<a href=${href(['people', a.trainee])}>${whomName(a)}</a>`;
      return html`
        <${AddAssignment} all=${all} done=${pages.load.reload} />
        <${Loaded} load=${pages.load}>${() =>
          pages.items.length === 0
            ? html`<${Empty} title="Nothing is assigned yet">Choose a course and a group above.<//>`
            : html`<${Table}
                caption=${pages.caption('assignment')}
                head=${['What', 'Assigned to', 'Due', 'Assigned', 'By', html`<span class="visually-hidden">Actions</span>`]}
              >${pages.items.map(
                (a) => html`<tr key=${a.id}>
                  <th scope="row">${what(a)}</th>
                  <td>${whom(a)}</td>
                  <td>${
                    a.due_unix_ms
                      ? html`
                          ${moment(a.due_unix_ms)} ${a.due_unix_ms < Date.now() && html`<${Mark} kind="warn">past<//>`}
                        `
                      : 'any time'
                  }</td>
                  <td>${moment(a.created_unix_ms)}</td>
                  <td>${a.by}</td>
                  <td>
                    <${DangerButton}
                      small
                      text="Withdraw"
                      label=${`Withdraw ${whatName(a)} from ${whomName(a)}`}
                      title="Withdraw the assignment?"
                      act=${() => drop(a.id)}
                    >
                      ${whatName(a)} for ${whomName(a)}. Results so far stay.
                    <//>
                  </td>
                </tr>`,
              )}<//>${pages.button}`}<//>
      `;
    }}<//>
  `;
}

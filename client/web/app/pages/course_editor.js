// Edits a course: its exercises in order, and one of them open.
import { courseFaults, exerciseName, freshId, withoutExercise } from '../lib/course_rules.js';
import { kMeasures } from '../lib/measure_rows.js';
import { may } from '../lib/roles.js';
import { isWithin } from '../lib/paths.js';
import { href } from '../lib/routes.js';
import { kCourseShape, shownOf } from '../lib/shape.js';
import { checkCourse, documents, measures } from '../net/requests.js';
import { announce, Heading, Problem } from '../ui/widgets.js';
import { ConflictDialog } from '../ui/conflict.js';
import { useDocument } from '../ui/document.js';
import { AsJson } from '../ui/as_json.js';
import { formOf, ProblemList } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useMemo, useState } from '../ui/html.js';
import { ExamFields } from '../course/exam.js';
import { ExerciseForm } from '../course/exercise.js';
import { ExerciseOrder } from '../course/order.js';
import { SaveBar, useBadFields, useCheck, useSaveKey } from './profile_editor.js';

const kBlank = { id: '', name: '', exercises: [] };

export function CourseEditor({ params, person }) {
  const id = params.id ?? '',
    readonly = !may(person.role, 'edit courses');
  const editing = useDocument('courses', id, () => kBlank);
  const known = useLoad(async (signal) => {
    const [profiles, all_measures] = await Promise.all([documents('profiles').all(signal), measures(signal)]);
    return { profiles, measures: all_measures };
  }, []);
  const [chosen, choose] = useState(0);
  const { why, onBad } = useBadFields();
  const { doc } = editing;
  // the server checks the names of measures
  const faults = useMemo(
    () =>
      doc ? courseFaults(shownOf(doc, kCourseShape).shown, { profiles: known.data?.profiles.map((p) => p.id) }) : [],
    [doc, known.data],
  );
  const { problems: said } = useCheck(doc, checkCourse);
  const save = async () => {
    if (readonly || why || faults.length > 0 || !editing.dirty) return;
    const saved = await editing.save();
    if (saved?.revision && !id) location.hash = href(['courses', doc.id]);
  };
  useSaveKey(save);
  const title = id ? (editing.base?.json.name ?? id) : 'New course',
    above = html`<a href="#/courses">Courses</a>`;
  if (!doc)
    return html`
      <${Heading} title=${title} above=${above} />
      ${
        editing.error
          ? html`<${Problem} error=${editing.error} retry=${editing.reload} />`
          : html`<p class="loading" role="status">Loading …</p>`
      }
    `;
  const refused = editing.saving.error?.field
    ? [{ path: editing.saving.error.field, message: editing.saving.error.said, severity: 'ERROR' }]
    : [];
  // the server also checks names of measures and bounds of numbers; a problem found here is not shown twice
  const problems = [...faults, ...[...said, ...refused].filter((p) => !faults.some((f) => isWithin(f.path, p.path)))];
  const f = formOf({ doc, shape: kCourseShape, change: editing.change, problems, onBad, readonly });
  const exercises = f.doc.exercises ?? [];
  const faulty = new Set(f.problems.map((p) => Number(/^exercises\[(\d+)\]/.exec(p.path)?.[1] ?? -1)));
  const add = () => {
    const exercise = {
      id: freshId(exercises),
      name: `Exercise ${exercises.length + 1}`,
      profile_id: '',
      requirements: [
        { measure: kMeasures.target, min: 1 },
        { measure: kMeasures.hazard, max: 0 },
        { measure: kMeasures.bone, max: 1 },
      ],
    };
    f.edit('exercises', (all = []) => [...all, exercise]);
    choose(exercises.length);
    announce(`Exercise ${exercises.length + 1} was added.`);
  };
  const remove = (index) => {
    f.edit('exercises', (all) => withoutExercise(all, index));
    choose(Math.max(0, Math.min(chosen, exercises.length - 2)));
    announce(`${exerciseName(exercises[index], index)} was removed.`);
  };
  return html`
    <${Heading} title=${title} above=${above}>${
      id &&
      html`
        <a class="button" href=${href(['courses', id, 'revisions'])}>Revisions</a>
        <a class="button" href=${href(['results'], { course: id })}>Results</a>
      `
    }<//>
    <${SaveBar} editing=${editing} save=${save} what="course" bad=${faults.length > 0} why=${why} readonly=${readonly} />
    <${Problem} error=${known.error} retry=${known.reload} />
    <form onSubmit=${(event) => event.preventDefault()} aria-label="Course">
      <fieldset>
        <legend>Course</legend>
        <div class="fields">
          ${
            !id &&
            f.text('id', 'Id', { required: true, help: "letters, digits, '-', '_', '.'; cannot be changed later" })
          }
          ${f.text('name', 'Name', { required: true })}
        </div>
        ${f.text('description', 'Description', { rows: 2, wide: true })}
        <${ExamFields} f=${f} />
      </fieldset>
      <div class="course-columns">
        <div>
          <${ExerciseOrder} f=${f} chosen=${chosen} choose=${choose} add=${add} remove=${remove} faulty=${faulty} />
          <${ProblemList} problems=${f.problems} />
        </div>
        <div>${
          exercises[chosen] &&
          html`<${ExerciseForm}
            key=${chosen}
            f=${f}
            index=${chosen}
            profiles=${known.data?.profiles ?? []}
            measures=${known.data?.measures ?? []}
          />`
        }</div>
      </div>
      <${AsJson} whole=${doc} change=${editing.change} onBad=${onBad} turn=${editing.turn} readonly=${readonly} />
    </form>
    ${
      editing.conflict &&
      html`<${ConflictDialog} conflict=${editing.conflict} settle=${editing.settle} close=${editing.closeConflict} />`
    }
  `;
}

// Who may take a course, and whether it is an exam.
import { withoutExam } from '../lib/course_rules.js';
import { fromInput, toInput } from '../lib/time.js';
import { CheckField, problemsAt, TextField } from '../ui/fields.js';
import { html } from '../ui/html.js';

/** @param {{f: any}} props of the course's form */
export function ExamFields({ f }) {
  const { exam, assigned_only, results_from_unix_ms } = f.doc;
  return html`
    <${CheckField}
      label="Only for those it is assigned to"
      checked=${exam || assigned_only}
      disabled=${f.readonly || exam}
      help="others cannot see it, here or at a station, or begin it"
      onValue=${(on) => f.set('assigned_only')(on || undefined)}
    />
    <${CheckField}
      label="Exam"
      checked=${exam}
      disabled=${f.readonly}
      help="only the aids that an exercise lists, which cannot be changed during a lesson, and one attempt unless the exercise gives another number"
      onValue=${(on) => (on ? f.set('exam')(true) : f.change(withoutExam))}
    />
    ${
      exam &&
      html`<div class="fields">
        <${TextField}
          label="Results are shown from"
          type="datetime-local"
          path="results_from_unix_ms"
          problems=${problemsAt(f.problems, 'results_from_unix_ms')}
          value=${toInput(results_from_unix_ms)}
          readonly=${f.readonly}
          onValue=${(v) => f.set('results_from_unix_ms')(fromInput(v))}
          help="empty: at once; staff always see them"
        />
      </div>`
    }
  `;
}

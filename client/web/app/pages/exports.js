// Data for other tools. A new format is one line in the list.
import { may } from '../lib/roles.js';
import { counted } from '../lib/units.js';
import { address } from '../net/api.js';
import { documents, exercises, groups, studyRecords } from '../net/requests.js';
import { Heading, Loaded, Problem, saveAs } from '../ui/widgets.js';
import { CheckField, SelectField, TextField } from '../ui/fields.js';
import { SearchField } from '../ui/search_field.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';

/** @type {{name: string, words: string, link: (choice: {course: string, group: string}) => string}[]} */
const kScoreFormats = [
  {
    name: 'CSV',
    words: 'one row per attempt and measure, units in the header',
    link: (choice) => address(['scores.csv'], choice),
  },
];

function Scores({ all }) {
  const [choice, setChoice] = useState({ course: '', group: null });
  return html`<fieldset>
    <legend>Scores</legend>
    <div class="fields">
      <${SelectField}
        label="Course"
        value=${choice.course}
        onValue=${(course) => setChoice({ ...choice, course })}
        options=${[['', 'All courses'], ...all.courses.map((c) => [c.id, c.name])]}
      />
      <${SearchField}
        label="Group"
        chosen=${choice.group}
        find=${groups.find}
        placeholder="All groups"
        onChoose=${(group) => setChoice({ ...choice, group })}
      />
    </div>
    <ul class="plain">${kScoreFormats.map(
      (f) =>
        html`<li>
          <a class="button main" href=${f.link({ course: choice.course, group: choice.group?.key ?? '' })} download>Download scores as ${f.name}</a> <span
            class="help"
          >${f.words}</span>
        </li>`,
    )}</ul>
  </fieldset>`;
}

/** The people who consent, under pseudonyms: one record per line, in the command line's format. */
function Study({ all }) {
  const [ask, setAsk] = useState({ study: '', exercise: '', remarks: false });
  const [count, setCount] = useState(0);
  const [result, setResult] = useState(null);
  const action = useAction();
  const set = (key) => (value) => setAsk({ ...ask, [key]: value });
  const save = async (event) => {
    event.preventDefault();
    setCount(0);
    setResult(null);
    const study = ask.study.trim(),
      records = await action.run(() => studyRecords(study, ask, setCount));
    if (!records) return;
    saveAs(`${study}.jsonl`, records.map((r) => JSON.stringify(r) + '\n').join(''), 'application/x-ndjson');
    setResult(records.find((r) => r.kind === 'study') ?? { people: 0, sessions: 0 });
  };
  return html`<form onSubmit=${save}>
    <fieldset>
      <legend>Study</legend>
      <p>
        Scores, measures and profiles of people who consent, under pseudonyms that are the same within one study and
        tell nothing across studies.
      </p>
      <div class="fields">
        <${TextField}
          label="Study"
          value=${ask.study}
          onValue=${set('study')}
          required
          maxlength="64"
          autocomplete="off"
          help="its name makes the pseudonyms: the same name, the same people"
        />
        <${SelectField}
          label="Exercise"
          value=${ask.exercise}
          onValue=${set('exercise')}
          options=${[['', 'All exercises'], ...all.exercises.map((e) => [e.id, e.name])]}
        />
      </div>
      <${CheckField}
        label="With remarks"
        checked=${ask.remarks}
        onValue=${set('remarks')}
        help="Names in them are replaced; read them before you pass them on."
      />
      <${Problem} error=${action.error} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy}>${
          action.busy ? `Collecting … ${counted(count, 'record')}` : 'Download the study'
        }</button>
      </div>
      <div role="status">${
        result &&
        html`<p>
          ✓ ${counted(result.people, 'person', 'people')}, ${counted(result.sessions, 'session')}.${result.people === 0 ? ' Nobody consents yet.' : ''}
        </p>`
      }</div>
    </fieldset>
  </form>`;
}

export function ExportsPage({ person }) {
  const staff = may(person.role, 'see results');
  const load = useLoad(async (signal) => {
    const [courses, all_exercises] = await Promise.all([documents('courses').all(signal), exercises(signal)]);
    return { courses, exercises: all_exercises };
  }, []);
  return html`
    <${Heading} title="Exports" />
    <${Loaded} load=${load}>${(all) => html`
      ${
        staff &&
        html`
          <${Scores} all=${all} />
          <fieldset>
            <legend>Samples of a session</legend>
            <p>Each <a href="#/sessions">session</a> has its samples as CSV: every tick, units in the header.</p>
          </fieldset>
        `
      }
      ${
        may(person.role, 'export study') &&
        html`
          <${Study} all=${all} />
          <p>The same by the command line, for scripts:</p>
          <pre tabindex="0">
            <code>
              needlelab-admin --server HOST:PORT --ca FILE --user ${person.name} study export STUDY --out FILE
            </code>
          </pre>
        `
      }
    `}<//>
  `;
}

// Data for other tools.
import { kExportFormats } from '../lib/export_formats.js';
import { may } from '../lib/roles.js';
import { counted } from '../lib/units.js';
import { address } from '../net/api.js';
import { documents, exercises, groups, studyRecords } from '../net/requests.js';
import { Heading, Loaded, Problem, saveAs } from '../ui/widgets.js';
import { CheckField, SelectField, TextField } from '../ui/fields.js';
import { SearchField } from '../ui/search_field.js';
import { DraftBack, useDraft } from '../ui/draft.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';

/** What a file of records holds, by the format's name; the browser writes it. */
const kRecordTexts = {
  jsonl: (records) => records.map((r) => JSON.stringify(r) + '\n').join(''),
};

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
    <ul class="plain">${kExportFormats.scores.map(
      (f) =>
        html`<li>
          <a class="button main" href=${address([`scores${f.suffix}`], { course: choice.course, group: choice.group?.key ?? '' })} download>Download scores as ${f.title}</a> <span
            class="help"
          >${f.words}</span>
        </li>`,
    )}</ul>
  </fieldset>`;
}

/** The people who consent, under pseudonyms, as the command line writes them. */
function Study({ all }) {
  const [ask, setAsk, draft] = useDraft('study', { study: '', exercise: '', remarks: false });
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
    draft.drop();
    const [format] = kExportFormats.study;
    saveAs(`${study}${format.suffix}`, kRecordTexts[format.name](records), format.type);
    setResult(records.find((r) => r.kind === 'study') ?? { people: 0, sessions: 0 });
  };
  return html`<form onSubmit=${save}>
    <fieldset>
      <legend>Study</legend>
      <${DraftBack} draft=${draft} />
      <p>
        Scores, measures and profiles of people who consent, under pseudonyms that are the same within one study and
        cannot be linked across studies.
      </p>
      <div class="fields">
        <${TextField}
          label="Study"
          value=${ask.study}
          onValue=${set('study')}
          required
          maxlength="64"
          autocomplete="off"
          help="pseudonyms depend on it: the same study gives the same pseudonyms"
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
          ✓ ${counted(result.people, 'person', 'people')}, ${counted(result.sessions, 'session')}.${result.people === 0 ? ' No one consents yet.' : ''}
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
            <p>
              Each <a href="#/sessions">session</a> has its samples
              as ${kExportFormats.samples.map((f) => `${f.title}: ${f.words}`).join('; as ')}.
            </p>
          </fieldset>
        `
      }
      ${
        may(person.role, 'export study') &&
        html`
          <${Study} all=${all} />
          <p>The same on the command line, for scripts:</p>
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

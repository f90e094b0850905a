// One exercise: patient, needle, aids, attempts, time, prerequisites, requirements.
import { fromInput, toInput } from '../lib/time.js';
import { exerciseName, numbered, planGivenBy, withExerciseId } from '../lib/course_rules.js';
import { toggled } from '../lib/paths.js';
import { problemWords } from '../lib/plain_words.js';
import { href } from '../lib/routes.js';
import { DangerButton, kOfTheForm } from '../ui/widgets.js';
import { Broken, CheckField, SelectField, TextField, problemsAt } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useMemo } from '../ui/html.js';
import { measureNamed, measuresOf, shownUnit } from '../lib/measures.js';
import { layerNames } from '../lib/tissue.js';
import { documents } from '../net/requests.js';

const kAids = [
  ['PHASE', 'Phase of the insertion'],
  ['LAYER', 'Tissue at the tip'],
  ['DEPTH', 'Depth'],
  ['FORCE', 'Force'],
  ['ULTRASOUND', 'Ultrasound-like slice'],
  ['TISSUES', 'Layers, translucent, with names'],
  ['ANATOMY', 'Targets and hazards'],
  ['GUIDES', 'Insertion line, wall'],
  ['ARROWS', 'Force arrows'],
  ['ALIGNMENT', 'Distance and tilt from own line, speed'],
  ['PLANNED_LINE', 'Planned entry and line'],
  ['ALARMS', 'Alarms: hazard, bone, force, depth (without: by feel)'],
  ['STEPS', 'What to do next, with its keys'],
];
const kUsualAids = kAids.map(([aid]) => aid).filter((aid) => aid !== 'ULTRASOUND' && aid !== 'STEPS');
const kTips = [
  ['', 'not known'],
  ['HYPODERMIC', 'Hypodermic'],
  ['QUINCKE', 'Quincke (spinal)'],
  ['TUOHY', 'Tuohy (epidural)'],
  ['PENCIL_POINT', 'Pencil point'],
];

function Aids({ f, at }) {
  const aids = f.at(`${at}.aids`);
  // no list means all aids but the slice, which takes time to draw, and the steps; in an exam it means none
  const usual = f.doc.exam ? [] : kUsualAids;
  const allowed = aids ? (aids.allowed ?? []) : usual;
  const faults = [`${at}.aids`, `${at}.aids.allowed`].filter(f.faultAt);
  const toggle = (aid) => (on) =>
    f.edit(`${at}.aids`, (before) => {
      const next = toggled(
        kAids.map(([name]) => name),
        before ? (before.allowed ?? []) : usual,
        aid,
        on,
      );
      return next.join() === usual.join() ? undefined : { ...before, allowed: next };
    });
  return html`<fieldset>
    <legend>What the station may show while practising</legend>
    ${faults.map((path) => html`<${Broken} f=${f} path=${path} />`)}
    ${kAids.map(
      ([aid, label]) =>
        html`<${CheckField}
          key=${aid}
          label=${label}
          checked=${allowed.includes(aid)}
          disabled=${f.readonly || faults.length > 0}
          onValue=${toggle(aid)}
        />`,
    )}
  </fieldset>`;
}

function Needle({ f, at }) {
  const own = f.at(`${at}.needle`);
  return html`
    <${CheckField}
      label="A needle other than the patient's"
      checked=${!!own}
      disabled=${f.readonly}
      onValue=${(on) => f.set(`${at}.needle`)(on ? { length_m: 0.06, gauge: 22, tip: 'HYPODERMIC' } : undefined)}
    />
    ${
      own &&
      html`<div class="fields">
        ${f.number(`${at}.needle.length_m`, 'Needle length')}
        ${f.number(`${at}.needle.gauge`, 'Gauge')}
        ${f.select(`${at}.needle.tip`, 'Tip', kTips)}
      </div>`
    }
  `;
}

const kLines = [
  ['direction', 'its direction into the tissue'],
  ['target_m', 'another point on it'],
];

function Plan({ f, at: exercise }) {
  const at = `${exercise}.plan`,
    plan = f.at(at);
  const put = f.set(at),
    by = plan?.target_m ? 'target_m' : 'direction';
  // problems of a whole vector, or of the plan; the fields show their own
  const problems = ['', '.frame', '.entry_m', '.direction', '.target_m'].flatMap((part) =>
    problemsAt(f.problems, at + part),
  );
  return html`
    <${CheckField}
      label="A planned entry and line"
      checked=${!!plan}
      disabled=${f.readonly}
      help="scores then say how far the entry, the angle and the path of the needle are from it"
      onValue=${(on) =>
        put(on ? { frame: 'LIMB', entry_m: { x: 0, y: 0, z: 0 }, direction: { x: 0, y: 0, z: -1 } } : undefined)}
    />
    ${
      plan &&
      html`<fieldset>
        <legend>Plan, in the frame of the patient's coordinates</legend>
        ${f.vector(`${at}.entry_m`, 'Entry on the skin')}
        <div class="fields">
          <${SelectField}
            label="The line is given by"
            value=${by}
            options=${kLines}
            disabled=${f.readonly}
            onValue=${(next) => f.edit(at, (whole) => planGivenBy(whole, next))}
          />
        </div>
        ${by === 'direction' ? f.vector(`${at}.direction`, 'Direction') : f.vector(`${at}.target_m`, 'Point')}
        ${problems.map((p) => html`<p class="error">✗ ${p.message}</p>`)}
      </fieldset>`
    }
  `;
}

function Prerequisites({ f, at, index }) {
  const before = f.doc.exercises.slice(0, index).filter((e) => e.id),
    chosen = (f.at(`${at}.prerequisites`) ?? []).filter((id) => id !== undefined);
  // a prerequisite that comes later in the course, or does not exist, can be removed
  const odd = chosen.filter((id) => !before.some((e) => e.id === id));
  const toggle = (id) => (on) =>
    f.edit(`${at}.prerequisites`, (all = []) => {
      const next = on ? [...all, id] : all.filter((other) => other !== id);
      return next.length ? next : undefined;
    });
  const problems = f.problems.filter((p) => p.path.startsWith(`${at}.prerequisites`));
  return html`<fieldset>
    <legend>${f.doc.exam ? 'Must be taken first' : 'Must be passed first'}</legend>
    ${
      before.length + odd.length === 0 && html`<p class="help">This is the first exercise: nothing comes before it.</p>`
    }
    ${[...before, ...odd.map((id) => ({ id, name: `${id} (further down)` }))].map(
      (e) =>
        html`<${CheckField}
          key=${e.id}
          label=${e.name || e.id}
          checked=${chosen.includes(e.id)}
          disabled=${f.readonly || !!f.faultAt(`${at}.prerequisites`)}
          onValue=${toggle(e.id)}
        />`,
    )}
    ${problems.map((p) => html`<p class="error">✗ ${problemWords(p)}</p>`)}
  </fieldset>`;
}

/** @param {{f: any, index: number, profiles: {id: string, name: string}[], measures: any[]}} props */
export function ExerciseForm({ f, index, profiles, measures }) {
  const at = `exercises[${index}]`,
    exercise = f.doc.exercises[index],
    patient = profiles.some((p) => p.id === exercise.profile_id) ? exercise.profile_id : '';
  const loaded = useLoad(
    (signal) => (patient ? documents('profiles').one(patient, undefined, signal) : Promise.resolve(null)),
    [patient],
  );
  const layers = useMemo(() => layerNames(loaded.data?.json), [loaded.data]);
  const name = exerciseName(exercise, index);
  const rename = (id) => f.edit('exercises', (all) => withExerciseId(all, index, id));
  const patients = [['', 'Choose …'], ...profiles.map((p) => [p.id, p.name])];
  if (exercise.profile_id && !profiles.some((p) => p.id === exercise.profile_id))
    patients.push([exercise.profile_id, `${exercise.profile_id} (does not exist)`]);
  if (f.faultAt(at))
    return html`<section class="card" aria-label=${name}>
      <h2>${numbered(index, name)}</h2>
      <${Broken} f=${f} path=${at} />
    </section>`;
  return html`<section class="card" aria-label=${`Exercise ${index + 1}: ${name}`}>
    <h2>${numbered(index, name)}</h2>
    <div class="fields">
      ${f.text(`${at}.id`, 'Exercise id', { required: true, onValue: rename })}
      ${f.text(`${at}.name`, 'Exercise name', { required: true })}
    </div>
    ${f.text(`${at}.description`, 'Exercise description', { rows: 2, wide: true })}
    <div class="fields">
      ${f.select(`${at}.profile_id`, 'Patient', patients, { wide: true })}
      ${f.number(`${at}.attempts`, 'Attempts', { help: f.doc.exam ? 'empty: one' : 'empty: no limit' })}
      ${f.number(`${at}.time_limit_s`, 'Time limit', { help: "from the needle's first contact; empty: none" })}
      ${f.number(`${at}.target_dwell_s`, 'Stay in the target', { help: 'to reach it; empty: 0.5 s' })}
      <${TextField}
        label="Due"
        type="datetime-local"
        path=${`${at}.due_unix_ms`}
        problems=${problemsAt(f.problems, `${at}.due_unix_ms`)}
        value=${toInput(exercise.due_unix_ms)}
        readonly=${f.readonly}
        onValue=${(v) => f.set(`${at}.due_unix_ms`)(fromInput(v))}
        help="empty: any time; an assignment's own date takes precedence"
      />
    </div>
    ${
      exercise.profile_id &&
      html`<p>
        <a href=${href(['profiles', exercise.profile_id])}>View the patient</a> · <a
          href=${href(['references', exercise.id])}
        >
          Choose its experts
        </a>
      </p>`
    }
    <${Needle} f=${f} at=${at} />
    <${Plan} f=${f} at=${at} />
    <${Prerequisites} f=${f} at=${at} index=${index} />
    <${Aids} f=${f} at=${at} />
    <${Requirements} f=${f} at=${at} measures=${measures} layers=${layers} />
  </section>`;
}

/**
 * @param {{f: any, at: string, measures: import('../lib/measures.js').Kind[], layers: string[]}} props `at`: the
 *   exercise's path; `layers`: names of the patient's
 */
export function Requirements({ f, at, measures, layers }) {
  const path = `${at}.requirements`;
  const rules = f.at(path) ?? [];
  const edit = (next) => f.edit(path, (all = []) => next(all));
  const named = (name) => measureNamed(measures, name, layers);
  const options = (name) => {
    const all = measuresOf(measures, layers),
      // a layer that the patient does not have, perhaps because the patient is still being loaded
      other = name && !all.some((m) => m.name === name) ? [named(name) ?? { name }] : [];
    return [['', 'Choose …'], ...[...all, ...other].map((m) => [m.name, m.words ?? m.name])];
  };
  return html`
    <h3>Requirements to pass</h3>
    <${Broken} f=${f} path=${path} />
    ${
      rules.length === 0 &&
      !f.faultAt(path) &&
      html`<p class="help">Without requirements every attempt is practice and gets no verdict.</p>`
    }
    <div>${rules.map((rule, i) => {
      const known = named(rule.measure);
      const { factor, unit } = shownUnit(rule.measure ?? '', known?.unit ?? '');
      const name = known?.words ?? rule.measure ?? `requirement ${i + 1}`;
      return html`<div key=${i} class="requirement fields" role="group" aria-label=${`Requirement ${i + 1}: ${name}`}>
        ${f.select(`${path}[${i}].measure`, 'Measure', options(rule.measure))}
        ${f.number(`${path}[${i}].min`, 'At least', { factor, unit })}
        ${f.number(`${path}[${i}].max`, 'At most', { factor, unit })}
        ${
          !f.readonly &&
          html`<div class="actions">
            <${DangerButton}
              small
              text="Remove"
              label=${`Remove requirement ${i + 1}`}
              title=${`Remove requirement ${i + 1}, ${name}?`}
              act=${() => edit((all) => all.filter((_, k) => k !== i))}
            >
              ${kOfTheForm}
            <//>
          </div>`
        }
      </div>`;
    })}</div>
    ${
      !f.readonly &&
      !f.faultAt(path) &&
      html`<button type="button" onClick=${() => edit((all) => [...all, { measure: '' }])}>Add a requirement</button>`
    }
  `;
}

// The parts of a profile besides layers and anatomy: name, needle, axial model, effects.
import { CheckField, TextField } from '../ui/fields.js';
import { html, useEffect, useState } from '../ui/html.js';
import { words } from '../lib/units.js';

const kTips = [
  ['', 'not known'],
  ['HYPODERMIC', 'Hypodermic'],
  ['QUINCKE', 'Quincke (spinal)'],
  ['TUOHY', 'Tuohy (epidural)'],
  ['PENCIL_POINT', 'Pencil point'],
];
const kModels = [
  ['ENHANCED_TRACKING_WALL', 'Enhanced tracking wall'],
  ['TRACKING_WALL', 'Tracking wall'],
  ['DIRECT', 'Direct'],
  ['VOIGT', 'Voigt'],
  ['GOD_OBJECT', 'God object'],
  ['FIRST_ORDER', 'First order'],
  ['STATISTICAL', 'Statistical'],
  ['PRECOMPUTED', 'Precomputed'],
  ['FEM', 'Finite elements'],
];
const kModelFields = {
  DIRECT: [['direct.stiffness_n_per_m', 'Stiffness']],
  VOIGT: [
    ['voigt.stiffness_n_per_m', 'Stiffness'],
    ['voigt.damping_ns_per_m', 'Damping'],
  ],
  GOD_OBJECT: [['god_object.stiffness_n_per_m', 'Stiffness']],
};
/** [effect, title, its section of the profile, the section's initial content] */
const kEffects = [
  ['CUTTING', 'Cutting: what resists the needle on its way in'],
  ['ATTRACTED', 'Attraction: what holds the needle on its way out'],
  [
    'CLAMPING',
    'Clamping: what keeps the needle on its line',
    'virtual_fixture',
    { max_stiffness_n_per_m: 400, max_force_n: 4, mode: 'PASSIVE' },
  ],
  [
    'ORIENTATION_LIMIT',
    'Orientation limit: what resists tilting',
    'orientation_limit',
    { stiffness_nm_per_rad: 0.5, max_torque_nm: 0.2 },
  ],
  ['SHAFT_FRICTION', 'Shaft friction', 'shaft_friction', { stiffness_n_per_m: 140 }],
  ['PUNCTURE', 'Puncture: membranes that give way'],
];

export function Naming({ f, is_new }) {
  return html`<fieldset>
    <legend>Patient</legend>
    <div class="fields">
      ${
        is_new &&
        f.text('id', 'Id', { help: "letters, digits, '-', '_', '.'; never changed afterwards", required: true })
      }
      ${f.text('name', 'Name', { required: true })}
    </div>
    ${f.text('description', 'Description', { rows: 2, wide: true })}
    ${f.text('sources', 'Where the numbers come from', { rows: 2, wide: true })}
  </fieldset>`;
}

export function NeedleFields({ f }) {
  return html`<fieldset>
    <legend>Needle</legend>
    <div class="fields">
      ${f.number('needle.length_m', 'Length')}
      ${f.number('needle.gauge', 'Gauge', { help: '10–34, thicker to thinner' })}
      ${f.select('needle.tip', 'Tip', kTips)}
      ${f.number('needle.outer_diameter_m', 'Outer diameter')}
      ${f.number('needle.bevel_angle_rad', 'Bevel angle')}
    </div>
  </fieldset>`;
}

export function Force({ f }) {
  const model = f.doc.axial_model ?? 'ENHANCED_TRACKING_WALL';
  const effects = f.doc.effects ?? [];
  const toggle =
    ([effect, , section, begin]) =>
    (on) =>
      f.change((before) => {
        const list = kEffects
          .map(([name]) => name)
          .filter((name) => (name === effect ? on : before.effects?.includes(name)));
        return { ...before, effects: list, ...(on && section && !before[section] ? { [section]: begin } : {}) };
      });
  return html`<fieldset>
    <legend>Force</legend>
    <div class="fields">
      ${f.select('axial_model', 'Model along the needle', kModels)}
      ${f.number('max_force_n', 'Greatest force')}
    </div>
    ${
      ['STATISTICAL', 'PRECOMPUTED', 'FEM'].includes(model) &&
      html`<p class="help">
        The numbers of this model come from tables: edit them below, in the profile as JSON, or import the file that
        needlelab-sim made.
      </p>`
    }
    ${
      kModelFields[model] &&
      html`<div class="fields">${kModelFields[model].map(([path, label]) =>
        f.number(path, `${label} (${words(model)})`),
      )}</div>`
    }
    <h3>Tracking wall</h3>
    <div class="fields">
      ${f.number('tracking_wall.stiffness_n_per_m', 'Wall stiffness')}
      ${f.number('tracking_wall.stop_speed_m_s', 'Counts as stopped below')}
      ${f.number('tracking_wall.stop_dwell_s', 'After')}
      ${f.number('tracking_wall.stop_duration_s', 'Relaxes in')}
      ${f.select('tracking_wall.stop_mode', 'Relaxation', [
        ['RAMP', 'Ramp'],
        ['EXPONENTIAL', 'Exponential'],
      ])}
      ${
        f.at('tracking_wall.stop_mode') === 'EXPONENTIAL' &&
        html`
          ${f.number('tracking_wall.relax_time_s', 'Relaxation time')}
          ${f.number('tracking_wall.relax_residual', 'Residue (0–1)')}
        `
      }
    </div>
    <h3>Effects</h3>
    ${kEffects.map(
      (entry) =>
        html`<${CheckField}
          key=${entry[0]}
          label=${entry[1]}
          checked=${effects.includes(entry[0])}
          disabled=${f.readonly}
          onValue=${toggle(entry)}
        />`,
    )}
    ${
      effects.includes('CLAMPING') &&
      html`
        <h3>Clamping</h3>
        <div class="fields">
          ${f.number('virtual_fixture.max_stiffness_n_per_m', 'Greatest stiffness')}
          ${f.number('virtual_fixture.max_force_n', 'Greatest clamping force')}
          ${f.select('virtual_fixture.mode', 'Mode', [
            ['PASSIVE', 'Passive: never pushes the hand'],
            ['PROPORTIONAL', 'Proportional: as in the paper'],
          ])}
        </div>
      `
    }
    ${
      effects.includes('ORIENTATION_LIMIT') &&
      html`
        <h3>Orientation limit</h3>
        <div class="fields">
          ${f.number('orientation_limit.stiffness_nm_per_rad', 'Rotational stiffness')}
          ${f.number('orientation_limit.max_torque_nm', 'Greatest torque')}
        </div>
      `
    }
    ${
      effects.includes('SHAFT_FRICTION') &&
      html`
        <h3>Shaft friction</h3>
        <div class="fields">${f.number('shaft_friction.stiffness_n_per_m', 'Friction stiffness')}</div>
      `
    }
  </fieldset>`;
}

/** The whole document as text, for values without a field. */
export function AsJson({ f }) {
  const written = JSON.stringify(f.doc, null, 2);
  const [text, setText] = useState(written);
  const [problem, setProblem] = useState('');
  useEffect(() => {
    if (!problem) setText(written);
  }, [written]);
  const take = (next) => {
    setText(next);
    try {
      f.change(JSON.parse(next));
      setProblem('');
    } catch (error) {
      setProblem(`This is no JSON yet: ${error.message}`);
    }
  };
  return html`<details>
    <summary>The whole as JSON</summary>
    <${TextField}
      label="JSON"
      rows="18"
      value=${text}
      onValue=${take}
      spellcheck="false"
      readonly=${f.readonly}
      wide
      path="json"
      problems=${problem ? [{ path: 'json', message: problem }] : []}
      class="mono"
    />
  </details>`;
}

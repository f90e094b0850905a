// The parts of a profile besides layers and anatomy: name, needle, axial model, effects.
import { Broken, CheckField } from '../ui/fields.js';
import { html } from '../ui/html.js';
import { toggled } from '../lib/paths.js';
import { kEffects } from './effects.js';
import { kModels } from './models.js';

const kTips = [
  ['', 'not known'],
  ['HYPODERMIC', 'Hypodermic'],
  ['QUINCKE', 'Quincke (spinal)'],
  ['TUOHY', 'Tuohy (epidural)'],
  ['PENCIL_POINT', 'Pencil point'],
];

export function Naming({ f, is_new }) {
  return html`<fieldset>
    <legend>Patient</legend>
    <div class="fields">
      ${
        is_new &&
        f.text('id', 'Id', { help: "letters, digits, '-', '_', '.'; cannot be changed later", required: true })
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
    <${Broken} f=${f} path="needle" />
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
  const chosen = f.doc.axial_model ?? 'ENHANCED_TRACKING_WALL';
  const model = kModels.find(({ name }) => name === chosen);
  const effects = f.doc.effects ?? [];
  const toggle =
    ({ name, section, begin }) =>
    (on) => {
      f.edit('effects', (all = []) =>
        toggled(
          kEffects.map((effect) => effect.name),
          all,
          name,
          on,
        ),
      );
      if (on && section && f.at(section) === undefined) f.set(section)(begin);
    };
  const bones = [f.at('volume.structures') ?? []].flat().filter((structure) => structure?.layer?.tissue === 'BONE');
  const landmarks = [['', 'none'], ...bones.map(({ id, layer }) => [id, layer.name ?? id])];
  const numbersOf = ({ section, title, fields, choice }) => html`<h3>${title}</h3>
    <${Broken} f=${f} path=${section} />
    <div class="fields">
      ${fields.map(([name, label]) => f.number(`${section}.${name}`, label))}
      ${choice && f.select(`${section}.${choice.name}`, choice.label, choice.options)}
      ${section === 'palpation' && f.select('palpation.landmark', 'Bone to find by feel', landmarks)}
      ${section === 'palpation' && f.text('palpation.landmark_name', 'The part of it to find, as trainees call it')}
    </div>`;
  return html`<fieldset>
    <legend>Force</legend>
    <div class="fields">
      ${f.select(
        'axial_model',
        'Model along the needle',
        kModels.map(({ name, label }) => [name, label]),
        { value: chosen },
      )}
      ${f.number('max_force_n', 'Greatest force')}
    </div>
    ${
      model?.table &&
      html`<p class="help">
        The numbers of this model come from tables: edit them below, in the profile as JSON, or import the file that
        needlelab-sim made.
      </p>`
    }
    ${
      model?.section &&
      html`<div class="fields">${model.fields.map(([name, label]) => f.number(`${model.section}.${name}`, label))}</div>`
    }
    <h3>Tracking wall</h3>
    <${Broken} f=${f} path="tracking_wall" />
    <div class="fields">
      ${f.number('tracking_wall.stiffness_n_per_m', 'Wall stiffness')}
      ${f.number('tracking_wall.stop_speed_m_s', 'Counts as stopped below')}
      ${f.number('tracking_wall.stop_dwell_s', 'After')}
      ${f.number('tracking_wall.stop_duration_s', 'Relaxes in')}
      ${f.select(
        'tracking_wall.stop_mode',
        'Relaxation',
        [
          ['RAMP', 'Ramp'],
          ['EXPONENTIAL', 'Exponential'],
        ],
        { value: f.at('tracking_wall.stop_mode') ?? 'RAMP' },
      )}
      ${
        f.at('tracking_wall.stop_mode') === 'EXPONENTIAL' &&
        html`
          ${f.number('tracking_wall.relax_time_s', 'Relaxation time')}
          ${f.number('tracking_wall.relax_residual', 'Residue (0–1)')}
        `
      }
    </div>
    <h3>Effects</h3>
    <${Broken} f=${f} path="effects" />
    ${kEffects.map(
      (effect) =>
        html`<${CheckField}
          key=${effect.name}
          label=${effect.label}
          checked=${effects.includes(effect.name)}
          disabled=${f.readonly || !!f.faultAt('effects')}
          onValue=${toggle(effect)}
        />`,
    )}
    ${kEffects.filter(({ name, section }) => section && effects.includes(name)).map(numbersOf)}
  </fieldset>`;
}

// Limb, targets and hazards: places in the limb's frame, z out of the body.
import { hazardAs, hazardForm, structuresOf, targetAs } from '../lib/body.js';
import { toggled } from '../lib/paths.js';
import { offsetUnder } from '../lib/scene.js';
import { hazardKindOf, layerNames } from '../lib/tissue.js';
import { words } from '../lib/units.js';
import { DangerButton, kOfTheForm } from '../ui/widgets.js';
import { Broken, CheckField, SelectField } from '../ui/fields.js';
import { html } from '../ui/html.js';

const kZero = { x: 0, y: 0, z: 0 };
const kShapes = {
  plane: { point_m: kZero, normal: { x: 0, y: 0, z: 1 } },
  sphere: { center_m: { x: 0, y: 0, z: -0.06 }, radius_m: 0.06 },
  capsule: { a_m: { x: -0.1, y: 0, z: -0.04 }, b_m: { x: 0.1, y: 0, z: -0.04 }, radius_m: 0.04 },
};
const kWords = { plane: 'Plane: a large surface', sphere: 'Ball', capsule: 'Rounded rod: an arm or a leg' };
const kHazards = ['BONE', 'NERVE', 'VESSEL', 'OTHER'];

export function LimbFields({ f }) {
  const shape = Object.keys(kShapes).find((key) => f.doc.limb?.[key]) ?? '';
  return html`<fieldset>
    <legend>Limb</legend>
    ${shape && html`<${Broken} f=${f} path=${`limb.${shape}`} />`}
    <${SelectField}
      label="Shape"
      path="limb"
      problems=${f.problems}
      value=${shape}
      disabled=${f.readonly}
      options=${[...(shape ? [] : [['', 'Choose …']]), ...Object.entries(kWords)]}
      onValue=${(key) => f.set('limb')({ [key]: kShapes[key] })}
    />
    ${shape === 'plane' && html`${f.vector('limb.plane.point_m', 'Point')}${f.vector('limb.plane.normal', 'Normal')}`}
    ${
      shape === 'sphere' &&
      html`${f.vector('limb.sphere.center_m', 'Centre')}${f.number('limb.sphere.radius_m', 'Radius')}`
    }
    ${
      shape === 'capsule' &&
      html`
        ${f.vector('limb.capsule.a_m', 'One end')}
        ${f.vector('limb.capsule.b_m', 'Other end')}
        ${f.number('limb.capsule.radius_m', 'Radius')}
      `
    }
  </fieldset>`;
}

const kWays = [
  ['plus_x', '+x'],
  ['minus_x', '−x'],
  ['plus_y', '+y'],
  ['minus_y', '−y'],
  ['plus_z', '+z'],
  ['minus_z', '−z'],
];

/** The usual names of the directions along the axes, for the words of a miss. */
export function DirectionFields({ f }) {
  return html`<fieldset>
    <legend>Directions</legend>
    <${Broken} f=${f} path="directions" />
    <p class="help">
      As words of a sentence, “towards the head”: a trainee reads “Missed by 2.1 mm towards the head”. Leave empty what
      has no name.
    </p>
    <div class="fields">${kWays.map(([way, label]) => f.text(`directions.${way}`, label))}</div>
  </fieldset>`;
}

function Remove({ f, list, i, what }) {
  return (
    !f.readonly &&
    html`<${DangerButton}
      small
      text="Remove"
      label=${`Remove ${what} ${i + 1}`}
      title=${`Remove ${what} ${i + 1}?`}
      act=${() => f.edit(list, (all) => all.filter((_, k) => k !== i))}
    >
      ${kOfTheForm}
    <//>`
  );
}

/** The structure that a target or hazard is. @param {{f: any, path: string, none?: string, onValue: (id: string) => void}} props */
function StructureField({ f, path, none, onValue }) {
  return html`<${SelectField}
    label="Structure"
    path=${`${path}.structure`}
    problems=${f.problems}
    value=${f.at(path).structure ?? ''}
    disabled=${f.readonly}
    options=${[...(none ? [['', none]] : []), ...structuresOf(f.doc)]}
    onValue=${onValue}
  />`;
}

/** The layer with which a target or hazard moves; choosing one does not move it, but in a body, to its top. */
function AnchorFields({ f, path }) {
  const anchor = f.at(path)?.anchor;
  const choose = (layer) =>
    f.set(`${path}.anchor`)(layer === '' ? undefined : { layer, offset_m: offsetUnder(f.doc, f.at(path), layer) });
  return html`<div class="fields">
    <${SelectField}
      label="Moves with the top of"
      path=${`${path}.anchor.layer`}
      problems=${f.problems}
      value=${anchor?.layer ?? ''}
      disabled=${f.readonly}
      options=${[['', 'no layer: it stays'], ...layerNames(f.doc).map((name) => [name, name])]}
      onValue=${choose}
    />
    ${anchor && f.number(`${path}.anchor.offset_m`, 'Its middle, under that')}
  </div>`;
}

/** The layers that count; a renamed layer stays, so that it can be unticked. */
function TargetTissues({ f, i, tissues }) {
  const path = `targets[${i}].tissues`,
    layers = layerNames(f.doc),
    all = [...layers, ...tissues.filter((name) => !layers.includes(name))];
  return html`<fieldset data-path=${path}>
    <legend>Tissues that count</legend>
    <p class="help">A point is in the target when it is within the radius and in one of these; none ticked: in any.</p>
    <${Broken} f=${f} path=${path} />
    ${all.map(
      (name) =>
        html`<${CheckField}
          key=${name}
          label=${layers.includes(name) ? name : `${name} (no such layer)`}
          checked=${tissues.includes(name)}
          disabled=${f.readonly || !!f.faultAt(path)}
          onValue=${(on) => f.edit(path, (list = []) => toggled(all, list, name, on))}
        />`,
    )}
  </fieldset>`;
}

export function TargetFields({ f, i, target }) {
  const path = `targets[${i}]`,
    is_structure = target.structure !== undefined;
  return html`
    <div class="fields">
      ${f.text(`${path}.name`, 'Name', { required: true })}
      ${
        (f.doc.volume || is_structure) &&
        html`<${StructureField}
          f=${f}
          path=${path}
          none="none: a ball"
          onValue=${(id) => f.edit(path, (before) => targetAs(id, before))}
        />`
      }
      ${!is_structure && f.number(`${path}.radius_m`, 'Radius')}
    </div>
    ${f.vector(`${path}.center_m`, is_structure ? 'Point to aim at' : 'Centre')}
    ${
      !is_structure &&
      html`
        <${AnchorFields} f=${f} path=${path} />
        <${TargetTissues} f=${f} i=${i} tissues=${target.tissues ?? []} />
      `
    }
  `;
}

export function Targets({ f }) {
  const targets = f.doc.targets ?? [];
  return html`<fieldset>
    <legend>Targets</legend>
    <${Broken} f=${f} path="targets" />
    ${
      targets.length === 0 &&
      !f.faultAt('targets') &&
      html`<p class="help">Without a target, the measures of aim are left out.</p>`
    }
    <ul class="cards">${targets.map(
      (target, i) => html`<li class="card" key=${i}>
        <div class="card-head">
          <h2>${target.name || `Target ${i + 1}`}</h2>
          <${Remove} f=${f} list="targets" i=${i} what="target" />
        </div>
        ${
          f.faultAt(`targets[${i}]`)
            ? html`<${Broken} f=${f} path=${`targets[${i}]`} />`
            : html`<${TargetFields} f=${f} i=${i} target=${target} />`
        }
      </li>`,
    )}</ul>
    ${
      !f.readonly &&
      !f.faultAt('targets') &&
      html`<button
        type="button"
        onClick=${() =>
          f.edit('targets', (all = []) => [
            ...all,
            { name: 'target', center_m: { x: 0, y: 0, z: -0.02 }, radius_m: 0.003 },
          ])}
      >
        Add a target
      </button>`
    }
  </fieldset>`;
}

export function HazardFields({ f, i, hazard }) {
  const path = `hazards[${i}]`,
    form = hazardForm(hazard);
  const first = structuresOf(f.doc)[0]?.[0];
  return html`
    <div class="fields">
      ${f.text(`${path}.name`, 'Name', { required: true })}
      ${f.select(`${path}.kind`, 'Kind', [
        ...(form === 'structure'
          ? [['', `That of its structure: ${words(hazardKindOf(f.doc, { ...hazard, kind: undefined }))}`]]
          : []),
        ...kHazards.map((k) => [k, words(k)]),
      ])}
      <${SelectField}
        label="Form"
        value=${form}
        disabled=${f.readonly}
        options=${[
          ['ball', 'Ball'],
          ['line', 'Line with thickness'],
          ...(f.doc.volume || form === 'structure' ? [['structure', 'Structure of the body']] : []),
        ]}
        onValue=${(next) => f.edit(path, (before) => hazardAs(next, before, first))}
      />
      ${
        form === 'structure'
          ? html`<${StructureField} f=${f} path=${path} onValue=${f.set(`${path}.structure`)} />`
          : f.number(`${path}.radius_m`, 'Radius')
      }
    </div>
    ${form === 'line' && html`${f.vector(`${path}.a_m`, 'From')}${f.vector(`${path}.b_m`, 'To')}`}
    ${form === 'ball' && f.vector(`${path}.center_m`, 'Centre')}
    ${form !== 'structure' && html`<${AnchorFields} f=${f} path=${path} />`}
  `;
}

export function Hazards({ f }) {
  const hazards = f.doc.hazards ?? [];
  return html`<fieldset>
    <legend>Hazards</legend>
    <${Broken} f=${f} path="hazards" />
    <ul class="cards">${hazards.map(
      (hazard, i) => html`<li class="card" key=${i}>
        <div class="card-head">
          <h2>${hazard.name || `Hazard ${i + 1}`}</h2>
          <${Remove} f=${f} list="hazards" i=${i} what="hazard" />
        </div>
        ${
          f.faultAt(`hazards[${i}]`)
            ? html`<${Broken} f=${f} path=${`hazards[${i}]`} />`
            : html`<${HazardFields} f=${f} i=${i} hazard=${hazard} />`
        }
      </li>`,
    )}</ul>
    ${
      !f.readonly &&
      !f.faultAt('hazards') &&
      html`<button
        type="button"
        onClick=${() =>
          f.edit('hazards', (all = []) => [
            ...all,
            { name: 'hazard', kind: 'NERVE', center_m: { x: 0.01, y: 0, z: -0.03 }, radius_m: 0.002 },
          ])}
      >
        Add a hazard
      </button>`
    }
  </fieldset>`;
}

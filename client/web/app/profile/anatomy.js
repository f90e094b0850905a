// Limb, targets and hazards: places in the limb's frame, z out of the body.
import { words } from '../lib/units.js';
import { Broken, SelectField } from '../ui/fields.js';
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

function Remove({ f, list, i, what }) {
  return (
    !f.readonly &&
    html`<button
      type="button"
      class="small danger"
      aria-label=${`Remove ${what} ${i + 1}`}
      onClick=${() => f.edit(list, (all) => all.filter((_, k) => k !== i))}
    >
      Remove
    </button>`
  );
}

export function Targets({ f }) {
  const targets = f.doc.targets ?? [];
  return html`<fieldset>
    <legend>Targets</legend>
    <${Broken} f=${f} path="targets" />
    ${
      targets.length === 0 &&
      !f.faultAt('targets') &&
      html`<p class="help">Without a target nothing can be reached: the measures of aim are left out.</p>`
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
            : html`
                <div class="fields">
                  ${f.text(`targets[${i}].name`, 'Name', { required: true })}
                  ${f.number(`targets[${i}].radius_m`, 'Radius')}
                </div>
                ${f.vector(`targets[${i}].center_m`, 'Centre')}
              `
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

function HazardFields({ f, i, hazard, onForm }) {
  return html`
    <div class="fields">
      ${f.text(`hazards[${i}].name`, 'Name', { required: true })}
      ${f.select(
        `hazards[${i}].kind`,
        'Kind',
        kHazards.map((k) => [k, words(k)]),
      )}
      <${SelectField}
        label="Form"
        value=${hazard.a_m ? 'line' : 'ball'}
        disabled=${f.readonly}
        options=${[
          ['ball', 'Ball'],
          ['line', 'Line with thickness'],
        ]}
        onValue=${onForm}
      />
      ${f.number(`hazards[${i}].radius_m`, 'Radius')}
    </div>
    ${
      hazard.a_m
        ? html`${f.vector(`hazards[${i}].a_m`, 'From')}${f.vector(`hazards[${i}].b_m`, 'To')}`
        : f.vector(`hazards[${i}].center_m`, 'Centre')
    }
  `;
}

export function Hazards({ f }) {
  const hazards = f.doc.hazards ?? [];
  const form = (i) => (value) =>
    f.edit(`hazards[${i}]`, ({ center_m, a_m, b_m, ...rest }) => {
      const at = center_m ?? a_m ?? kZero;
      return value === 'ball'
        ? { ...rest, center_m: at }
        : { ...rest, a_m: at, b_m: { ...at, x: (Number(at.x) || 0) + 0.02 } };
    });
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
            : html`<${HazardFields} f=${f} i=${i} hazard=${hazard} onForm=${form(i)} />`
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

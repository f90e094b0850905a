// The layers, from the skin inwards: one card each; order by buttons or Alt and arrows.
import { moved } from '../lib/paths.js';
import { kTissues, layerNames, tissueColor } from '../lib/tissue.js';
import { atStart, quantity, words } from '../lib/units.js';
import { announce, DangerButton, kOfTheForm } from '../ui/widgets.js';
import { Broken, CheckField } from '../ui/fields.js';
import { html } from '../ui/html.js';
import { kModels } from './models.js';

const kNew = {
  tissue: 'MUSCLE',
  thickness_m: 0.01,
  cutting_force_n: 1,
  attracted_force_n: 0.4,
  rejection_force_n: 0.1,
  lateral_stiffness_n_per_m2: 9000,
  friction_n_per_m: 20,
};
const kPuncture = { linear_n_per_m: 200, quadratic_n_per_m2: 20000, force_n: 0.6 };

export function Swatch({ color }) {
  return html`<svg class="swatch" viewBox="0 0 16 16" aria-hidden="true">
    <rect width="16" height="16" fill=${color} stroke="#4a5a68" />
  </svg>`;
}

/** The membrane at the top of a layer or structure. @param {{f: any, path: string}} props `path`: the layer's */
export function Membrane({ f, path }) {
  const puncture = f.at(`${path}.puncture`);
  return html`
    <${CheckField}
      label="Membrane that gives way"
      checked=${!!puncture}
      disabled=${f.readonly}
      onValue=${(on) => f.set(`${path}.puncture`)(on ? { ...kPuncture } : undefined)}
    />
    ${
      puncture &&
      html`<div class="fields">
        ${f.number(`${path}.puncture.linear_n_per_m`, 'Stiffness')}
        ${f.number(`${path}.puncture.quadratic_n_per_m2`, 'Stiffening')}
        ${f.number(`${path}.puncture.force_n`, 'Gives way at')}
      </div>`
    }
  `;
}

/** @param {{f: any, i: number, layer: any, name: string}} props `name`: its usual name */
function LayerFields({ f, i, layer, name }) {
  const model = kModels.find((one) => one.name === f.doc.axial_model);
  return html`
    <div class="fields">
      ${f.select(
        `layers[${i}].tissue`,
        'Tissue',
        kTissues.map((t) => [t, words(t)]),
      )}
      ${f.text(`layers[${i}].name`, 'Name', { maxlength: 64, placeholder: layer.name ? '' : name })}
      ${f.number(`layers[${i}].thickness_m`, 'Thickness')}
      ${f.number(`layers[${i}].cutting_force_n`, 'Cutting force')}
      ${f.number(`layers[${i}].attracted_force_n`, 'Attracted force')}
      ${f.number(`layers[${i}].rejection_force_n`, 'Rejection force')}
      ${f.number(`layers[${i}].lateral_stiffness_n_per_m2`, 'Lateral stiffness')}
      ${f.number(`layers[${i}].friction_n_per_m`, 'Shaft friction')}
      ${model?.follows_layers && f.number(`layers[${i}].wall_stiffness_n_per_m`, 'Wall stiffness, if its own')}
    </div>
    <${Membrane} f=${f} path=${`layers[${i}]`} />
    ${
      model?.layer_section &&
      html`<div class="fields">${model.fields.map(([field, label]) =>
        f.number(`layers[${i}].${model.layer_section}.${field}`, label),
      )}</div>`
    }
  `;
}

export function Layers({ f }) {
  const layers = f.doc.layers ?? [];
  const names = layerNames(f.doc);
  // the document's own list: it keeps what the form cannot show
  const edit = (next) => f.edit('layers', (all = []) => next(all));
  const add = (at, layer) => {
    edit((all) => [...all.slice(0, at), layer, ...all.slice(at)]);
    requestAnimationFrame(() => document.querySelector(`#layer-${at} details`)?.setAttribute('open', ''));
  };
  const move = (from, to) => {
    if (to < 0 || to >= layers.length) return;
    edit((all) => moved(all, from, to));
    announce(`${atStart(names[from])} is layer ${to + 1} of ${layers.length} now.`);
    requestAnimationFrame(() => document.getElementById(`layer-${to}`)?.focus());
  };
  const keys = (i) => (event) => {
    if (!event.altKey || !['ArrowUp', 'ArrowDown'].includes(event.key) || f.readonly) return;
    event.preventDefault();
    move(i, i + (event.key === 'ArrowUp' ? -1 : 1));
  };
  const remove = (i) => {
    edit((all) => all.filter((_, k) => k !== i));
    announce(`Layer ${i + 1}, ${names[i]}, was removed.`);
  };
  return html`<fieldset>
    <legend>Layers, from the skin inwards</legend>
    <${Broken} f=${f} path="layers" />
    ${layers.length === 0 && !f.faultAt('layers') && html`<p>There are no layers yet. Add the skin first.</p>`}
    <ol class="cards">${layers.map(
      (layer, i) => html`<li key=${i} class="card" id=${`layer-${i}`} tabindex="-1" onKeyDown=${keys(i)}>
        <div class="card-head">
          <h2>
            <${Swatch} color=${tissueColor(layer.tissue)} /> ${i + 1}. ${atStart(names[i])} <span class="unit">${quantity(
              layer.thickness_m,
              'm',
            )}</span>
          </h2>
          ${
            !f.readonly &&
            html`<div class="actions">
              <button
                type="button"
                class="small"
                disabled=${i === 0}
                aria-label=${`Move layer ${i + 1} up`}
                onClick=${() => move(i, i - 1)}
              >
                ↑
              </button>
              <button
                type="button"
                class="small"
                disabled=${i === layers.length - 1}
                aria-label=${`Move layer ${i + 1} down`}
                onClick=${() => move(i, i + 1)}
              >
                ↓
              </button>
              <button
                type="button"
                class="small"
                aria-label=${`Add below layer ${i + 1}`}
                onClick=${() => add(i + 1, { ...kNew })}
              >
                Add below
              </button>
              <${DangerButton}
                small
                text="Remove"
                label=${`Remove layer ${i + 1}`}
                title=${`Remove layer ${i + 1}, ${names[i]}?`}
                act=${() => remove(i)}
              >
                ${kOfTheForm}
              <//>
            </div>`
          }
        </div>
        <details>
          <summary>Cutting ${quantity(layer.cutting_force_n, 'N')}${layer.puncture ? ', membrane' : ''}</summary>
          ${f.faultAt(`layers[${i}]`) ? html`<${Broken} f=${f} path=${`layers[${i}]`} />` : html`<${LayerFields} f=${f} i=${i} layer=${layer} name=${names[i]} />`}
        </details>
      </li>`,
    )}</ol>
    ${
      !f.readonly &&
      !f.faultAt('layers') &&
      html`<button
        type="button"
        onClick=${() => add(layers.length, { ...kNew, tissue: layers.length ? 'MUSCLE' : 'SKIN' })}
      >
        Add a layer at the bottom
      </button>`
    }
  </fieldset>`;
}

// The structures of a body: one is chosen, here or in the section, and has a few fields.
import { markOf } from '../lib/body.js';
import { kindOf, layerColors, layerNames, profileLayers } from '../lib/tissue.js';
import { atStart } from '../lib/units.js';
import { Broken, SelectField } from '../ui/fields.js';
import { html } from '../ui/html.js';
import { Membrane, Swatch } from './layers.js';

/** @param {{f: any, chosen: number, choose: (index: number) => void}} props `chosen`: its place in the list */
export function Structures({ f, chosen, choose }) {
  const layers = profileLayers(f.doc),
    paths = ['volume', 'volume.structures', ...layers.map((_, i) => `volume.structures[${i}].layer`)];
  const option = (name, i) => {
    const kind = atStart(kindOf(f.doc.volume.structures[i]).words),
      mark = markOf(f.doc, i);
    const more = [kind.toLowerCase() !== name.toLowerCase() && kind, mark && `${mark.kind}: ${mark.name}`].filter(
      Boolean,
    );
    return [String(i), `${atStart(name)}${more.length > 0 ? ` (${more.join('; ')})` : ''}`];
  };
  const path = `volume.structures[${chosen}].layer`;
  return html`<fieldset>
    <legend><${Swatch} color=${layerColors(f.doc)[chosen]} /> Structure</legend>
    ${paths.map((at) => html`<${Broken} f=${f} path=${at} />`)}
    <${SelectField}
      label="Chosen structure"
      help="or click on it in the section; its shapes are made by file, as in db/samples/volumes"
      value=${String(chosen)}
      options=${layerNames(f.doc).map(option)}
      onValue=${(i) => choose(Number(i))}
    />
    ${
      layers[chosen] &&
      !f.faultAt(path) &&
      html`<div class="fields" key=${chosen}>
          ${f.text(`${path}.name`, 'Name', { maxlength: 64 })}
          ${f.number(`${path}.cutting_force_n`, 'Cutting force')}
          ${f.number(`${path}.attracted_force_n`, 'Attracted force')}
          ${f.number(`${path}.lateral_stiffness_n_per_m2`, 'Lateral stiffness')}
          ${f.number(`${path}.friction_n_per_m`, 'Shaft friction')}
        </div>
        <${Membrane} key=${`membrane-${chosen}`} f=${f} path=${path} />`
    }
  </fieldset>`;
}

// The structures of a body: only shown.
import { markOf } from '../lib/body.js';
import { kindOf, layerColors, layerNames, profileLayers } from '../lib/tissue.js';
import { atStart } from '../lib/units.js';
import { Table } from '../ui/widgets.js';
import { Broken } from '../ui/fields.js';
import { html } from '../ui/html.js';
import { Swatch } from './layers.js';

export function Structures({ f }) {
  const colors = layerColors(f.doc),
    layers = profileLayers(f.doc),
    paths = ['volume', 'volume.structures', ...layers.map((_, i) => `volume.structures[${i}].layer`)];
  const mark = (i) => {
    const found = markOf(f.doc, i);
    return found ? `${found.kind}: ${found.name}` : '';
  };
  return html`<fieldset>
    <legend>Structures of the body</legend>
    <p class="help">
      Shapes and forces of a body are made by file, as in db/samples/volumes, and imported by “needlelab-admin profile
      import FILE”.
    </p>
    ${paths.map((path) => html`<${Broken} f=${f} path=${path} />`)}
    <${Table} caption="Structures, in the file’s order" hide_caption head=${['Structure', 'Kind', 'Target or hazard']}>${layerNames(
      f.doc,
    ).map(
      (name, i) => html`<tr key=${i}>
        <th scope="row"><${Swatch} color=${colors[i]} /> ${atStart(name)}</th>
        <td>${atStart(kindOf(f.doc.volume.structures[i]).words)}</td>
        <td>${mark(i)}</td>
      </tr>`,
    )}<//>
  </fieldset>`;
}

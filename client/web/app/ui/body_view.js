// A cut through a body, to scale: its structures with their names, targets, hazards, the place of insertion.
import { areasOf, entryIn, inSection, markOf } from '../lib/body.js';
import { atStart } from '../lib/units.js';
import { beside, Cut, Entry, kSigns, Ruler, Shapes, shapesOf } from './cut.js';
import { useWidth } from './hooks.js';
import { html, useMemo } from './html.js';

const kWidth = 640,
  kLetter_px = 6.6; // of a name, 12 px high

/**
 * @param {{section: any, profile: any, label: string, over?: (at: {x: (u: number) => number, y: (w: number) => number, scale: number}) => any, onPick?: (index: number) => void}} props
 *   `over` draws in pixels on top; `onPick`: a structure was clicked
 */
export function BodyView(props) {
  const [place, room] = useWidth(kWidth);
  const seen = useMemo(() => ({ areas: areasOf(props.section), entry: entryIn(props.section) }), [props.section]);
  return html`<${BodyDrawing} ...${props} ...${seen} place=${place} room=${room} />`;
}

/** @param {{section: any, profile: any, label: string, over?: any, onPick?: any, areas: any[], entry: any, place: any, room: number}} props `room`: the width in pixels */
export function BodyDrawing({ section, profile, label, over, onPick, areas, entry, place, room }) {
  const marked = areas.map((area) => ({ ...area, mark: markOf(profile, area.index) }));
  const longest = Math.max(0, ...areas.map((area) => area.name.length)),
    width = Math.max(320, room),
    beside_px = 26 + kLetter_px * (longest + 2),
    below = beside_px > width / 2, // the names
    names_px = below ? 0 : beside_px,
    edge = width - names_px,
    point_px = edge / section.columns, // of the grid
    height = section.rows * point_px,
    scale = point_px / section.point_m;
  const nameOf = ({ name, mark }) => (mark ? `${kSigns[mark.kind]} ` : '') + atStart(name);
  const names = below
    ? []
    : beside(
        marked.map((area) => ({ x: area.at.x * point_px, y: area.at.y * point_px, text: nameOf(area) })),
        height,
      );
  const x = (u) => u * scale;
  // where a structure is that moves a shape, only the engine knows
  const still = (regions) => regions?.filter((region) => !region.anchor);
  const shapes = shapesOf(
    { targets: still(profile.targets), hazards: still(profile.hazards) },
    (p) => inSection(section, p),
    true,
  );
  const areaOf = (tissues) =>
    areas
      .filter((area) => tissues.includes(area.name))
      .map((area) => html`<path d=${area.path} transform=${`scale(${point_px})`} />`);
  const moving = [...(profile.targets ?? []), ...(profile.hazards ?? [])].filter((region) => region.anchor);
  return html`
    <${Cut} place=${place} width=${width} height=${height} edge=${edge} names=${names} label=${label}>
      <clipPath id="section-clip"><rect x="0" y="0" width=${edge} height=${height} /></clipPath>
      <g clip-path="url(#section-clip)">
        <g transform=${`scale(${point_px})`} shape-rendering="crispEdges">
          ${marked.map(
            ({ index, path, color, name, mark }) => html`<g onClick=${() => onPick?.(index)}>
              <path d=${path} fill=${color}><title>${name}</title></path>
              ${mark && html`<path d=${path} class=${`shape-${mark.kind}-area`}><title>${`${mark.kind}: ${mark.name}`}</title></path>`}
            </g>`,
          )}
        </g>
        <${Shapes} shapes=${shapes} areaOf=${areaOf} x=${x} y=${x} scale=${scale} />
        ${entry && html`<${Entry} x=${x(entry.u)} y=${x(entry.w)} />`}
        ${over?.({ x, y: x, scale })}
      </g>
      <${Ruler} length_m=${0.01} scale=${scale} height=${height} />
    <//>
    ${
      below &&
      html`<ul class="drawing-legend">
        ${marked.map(
          (area) =>
            html`<li>
              <svg viewBox="0 0 24 12" aria-hidden="true"><rect width="24" height="12" fill=${area.color} /></svg>${nameOf(area)}
            </li>`,
        )}
      </ul>`
    }
    ${
      moving.length > 0 &&
      html`<p class="help">Not drawn, because a structure moves it: ${moving.map((region) => region.name).join(', ')}.</p>`
    }
  `;
}

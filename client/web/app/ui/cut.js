// What each drawing of a patient shows: targets and hazards as circles and rounded lines, names beside it, a ruler.
import { clearLabels, offPlane, offPlaneLabel, offPlaneOpacity, spread } from '../lib/scene.js';
import { quantity } from '../lib/units.js';
import { html } from './html.js';

const kGap = 18, // between names beside the drawing
  kLetter_px = 6.5, // of a label beside the plane: 11 px high
  kLine_px = 13;

/** Signs of structures that are targets and hazards. */
export const kSigns = { target: '◎', hazard: '⚠' };

/**
 * Targets and hazards in a plane, in metres. One that is a structure is drawn as the point that it gives, if it gives
 * one.
 * @param {{targets?: any[], hazards?: any[]}} profile
 * @param {(p: any) => {u: number, w: number, v: number}} at of a point: u and w in the plane, v behind it
 * @param {boolean} fade from above everything is seen; from the side, hazards beside the plane fade
 */
export function shapesOf({ targets, hazards }, at, fade) {
  const of = (kind, list) =>
    (list ?? [])
      .filter((x) => (x.structure ? x.center_m : x.radius_m > 0))
      .map((x) => ({
        kind,
        name: x.name,
        tissues: x.tissues ?? [],
        radius_m: Number(x.radius_m) || 0,
        a: at(x.center_m ?? x.a_m),
        b: x.center_m ? null : at(x.b_m),
      }))
      .map((x) => ({ ...x, off_m: kind === 'hazard' && fade ? offPlane(x.radius_m, x.a.v, (x.b ?? x.a).v) : 0 }));
  return [...of('hazard', hazards), ...of('target', targets)];
}

const radius_px = (shape, scale) => Math.max(2, shape.radius_m * scale);

export function Shape({ shape, x, y, scale }) {
  const title = html`<title>${`${shape.kind}: ${offPlaneLabel(shape.name, shape.off_m)}`}</title>`;
  const r = radius_px(shape, scale);
  return shape.b
    ? html`<line
        class=${'shape-' + shape.kind + '-line'}
        x1=${x(shape.a.u)}
        y1=${y(shape.a.w)}
        x2=${x(shape.b.u)}
        y2=${y(shape.b.w)}
        stroke-width=${2 * r}
        stroke-linecap="round"
        opacity=${offPlaneOpacity(shape.off_m)}
      >${title}</line>`
    : html`<circle
        class=${'shape-' + shape.kind}
        cx=${x(shape.a.u)}
        cy=${y(shape.a.w)}
        r=${r}
        opacity=${offPlaneOpacity(shape.off_m)}
      >${title}</circle>`;
}

/** Names of the shapes beside the plane, each below its shape. */
function ShapeLabels({ shapes, x, y, scale }) {
  const labels = shapes
    .map((shape) => {
      const text = offPlaneLabel(shape.name, shape.off_m),
        end = shape.b ?? shape.a;
      return {
        x: x((shape.a.u + end.u) / 2),
        y: y((shape.a.w + end.w) / 2) + radius_px(shape, scale) + 12,
        width: text.length * kLetter_px,
        text: text === shape.name ? '' : text,
      };
    })
    .filter((label) => label.text);
  const heights = clearLabels(labels, kLine_px);
  return labels.map((label, i) => html`<text class="shape-label" x=${label.x} y=${heights[i]}>${label.text}</text>`);
}

/**
 * All shapes of a cut, with the names of those beside it. A target is drawn only in the tissues that count.
 * @param {{shapes: any[], areaOf: (tissues: string[]) => any, x: (u: number) => number, y: (w: number) => number, scale: number}} props
 *   `areaOf` draws these tissues
 */
export function Shapes({ shapes, areaOf, x, y, scale }) {
  return html`
    ${shapes.map(
      (shape, i) =>
        html`<clipPath id=${`target-clip-${i}`}>${areaOf(shape.tissues)}</clipPath>
          <g clip-path=${shape.tissues.length > 0 ? `url(#target-clip-${i})` : undefined}>
            <${Shape} shape=${shape} x=${x} y=${y} scale=${scale} />
          </g>`,
    )}
    <${ShapeLabels} shapes=${shapes} x=${x} y=${y} scale=${scale} />
  `;
}

/**
 * Names of places in a drawing, from top to bottom, each with the height where it stands beside the drawing.
 * @param {{x: number, y: number, text: string}[]} labels
 * @param {number} height
 */
export function beside(labels, height) {
  const sorted = [...labels].sort((a, b) => a.y - b.y);
  const slots = spread(
    sorted.map((l) => l.y),
    kGap,
    12,
    Math.max(height - 6, 12 + kGap * sorted.length),
  );
  return sorted.map((label, i) => ({ ...label, slot: slots[i] }));
}

/** A drawing at its element's own width, with names to the right of `edge` that `beside` placed. */
export function Cut({ place, width, height, edge, names, label, children }) {
  return html`<svg
    ref=${place}
    class="section"
    viewBox=${`0 0 ${width} ${Math.max(height, names.at(-1)?.slot ?? 0) + 8}`}
    role="img"
    aria-label=${label}
  >
    <rect class="section-air" x="0" y="0" width=${edge} height=${height} />
    ${children}
    ${names.map(
      ({ x, y, slot, text }) => html`
        <circle class="leader-dot" cx=${x} cy=${y} r="2" />
        <polyline class="leader" points=${`${x},${y} ${edge + 8},${slot} ${edge + 16},${slot}`} />
        <text x=${edge + 19} y=${slot + 4}>${text}</text>
      `,
    )}
  </svg>`;
}

/** @param {{length_m: number, scale: number, height: number}} props `scale`: pixels of a metre */
export function Ruler({ length_m, scale, height }) {
  return html`<g class="ruler">
    <line x1="10" y1=${height - 10} x2=${10 + length_m * scale} y2=${height - 10} />
    <text x="10" y=${height - 15}>${quantity(length_m, 'm')}</text>
  </g>`;
}

/** The place of insertion: an arrow whose point is there, in pixels. */
export const Entry = ({ x, y }) =>
  html`<path class="entry" d=${`M${x} ${y}l-4 -9h8z`}><title>place of insertion</title></path>`;

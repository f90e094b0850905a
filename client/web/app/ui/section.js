// A cut through the limb, to scale: layers with their names, targets, hazards. A page can draw over it.
import {
  clearLabels,
  depthOf,
  frameOf,
  inFrame,
  layerBounds,
  layerLabels,
  levelLine,
  offPlane,
  offPlaneLabel,
  offPlaneOpacity,
  placed,
  spread,
} from '../lib/scene.js';
import { tissueColor } from '../lib/tissue.js';
import { quantity, words } from '../lib/units.js';
import { useWidth } from './hooks.js';
import { html, useMemo } from './html.js';

const kWidth = 640,
  kLabels = 185,
  kTop_m = 0.012,
  kHeight = 440,
  kGap = 18,
  kLetter_px = 6.5, // of a label beside the plane: 11 px high
  kLine_px = 13;

/** Shapes of a profile as circles or rounded lines in the plane (u, second). */
function shapes(doc, frame, second) {
  const profile = placed(doc);
  const at = (p) => {
    const f = inFrame(frame, p);
    return { u: f.u, w: f[second], v: f.v };
  };
  const of = (kind, list) =>
    (list ?? [])
      .filter((x) => x.radius_m > 0)
      .map((x) => ({
        kind,
        name: x.name,
        tissue: x.kind,
        tissues: x.tissues ?? [],
        radius_m: Number(x.radius_m),
        a: at(x.center_m ?? x.a_m),
        b: x.center_m ? null : at(x.b_m),
      }))
      // from above everything is seen; from the side, hazards beside the plane fade
      .map((x) => ({
        ...x,
        off_m: kind === 'hazard' && second === 'd' ? offPlane(x.radius_m, x.a.v, (x.b ?? x.a).v) : 0,
      }));
  return [...of('hazard', profile.hazards), ...of('target', profile.targets)];
}

const radius_px = (shape, scale) => Math.max(2, shape.radius_m * scale);

function Shape({ shape, x, y, scale }) {
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
function ShapeLabels({ shapes: all, x, y, scale }) {
  const labels = all
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
 * The side view.
 * @param {{profile: any, frame?: any, fidelity?: (number|null)[], to_m?: number, label: string, over?: (at: {x: (u: number) => number, y: (d: number) => number, scale: number}) => any}} props
 *   `over` draws in pixels on top
 */
export function SideView({ profile, frame: given, fidelity, to_m, label, over }) {
  // drawn at the element's own width: letters keep their size
  const [place, room] = useWidth(kWidth);
  const width = Math.max(320, room);
  const drawn = useMemo(() => {
    const layers = layerBounds(profile),
      frame = given ?? frameOf(profile.limb),
      depth = depthOf(profile.limb);
    const bottom_m = Math.max(0.01, to_m ?? 0, layers.at(-1)?.to_m ?? 0),
      height_m = bottom_m + kTop_m;
    const beside = layerLabels(layers, fidelity, kLabels, Math.max(kLabels, width / 2));
    const scale = Math.min(kHeight / height_m, (width - beside.width_px) / 0.02);
    const half_m = (width - beside.width_px) / scale / 2;
    const window = { from_u: -half_m, to_u: half_m, from_d: -kTop_m, to_d: bottom_m };
    const lines = layers.map((l) => levelLine(depth, frame, l.from_m, window));
    const all = shapes(profile, frame, 'd');
    return { layers, frame, bottom_m, scale, half_m, height: height_m * scale, lines, all, texts: beside.texts };
    // the numbers, because the page makes a new list each time
  }, [profile, given, to_m, width, fidelity?.join()]);
  const { texts, layers, scale, half_m, height, lines, all, bottom_m } = drawn;
  const x = (u) => (u + half_m) * scale,
    y = (d) => (d + kTop_m) * scale;
  const corner = (u, d) => `${x(u).toFixed(1)},${y(d).toFixed(1)}`;
  const area = (line) =>
    [...line.map((p) => corner(p.u, p.d)), corner(line.at(-1).u, bottom_m), corner(line[0].u, bottom_m)].join(' ');
  // a target is drawn only in the tissues that count
  const bandsOf = (shape) =>
    layers.flatMap((layer, i) => {
      if (!shape.tissues.includes(layer.name) || lines[i].length < 2) return [];
      const below =
        (lines[i + 1]?.length ?? 0) > 1
          ? lines[i + 1]
          : [
              { u: -half_m, d: bottom_m },
              { u: half_m, d: bottom_m },
            ];
      return [[...lines[i], ...below.toReversed()].map((p) => corner(p.u, p.d)).join(' ')];
    });
  const edge = x(half_m);
  // all leader lines begin in one column that crosses every layer, as far right as possible, in the order of the layers
  const ends = lines.map((line) => line.filter((p) => p.d < bottom_m * 0.98).at(-1)?.u ?? 0);
  const column = Math.max(0, Math.min(half_m * 0.985, ...ends.map((u) => (u >= half_m - 1e-9 ? half_m : u * 0.85))));
  const top = (i) =>
    lines[i]?.reduce((best, p) => (best && Math.abs(best.u - column) <= Math.abs(p.u - column) ? best : p), null)?.d ??
    bottom_m;
  const seen = (i) => ({ u: column, d: (top(i) + Math.max(top(i), i + 1 < lines.length ? top(i + 1) : bottom_m)) / 2 });
  const labels = layers
    .map((_, i) => {
      const at = seen(i);
      return { x: x(at.u), y: y(at.d), text: texts[i] };
    })
    .sort((a, b) => a.y - b.y);
  const slots = spread(
    labels.map((l) => l.y),
    kGap,
    12,
    Math.max(height - 6, 12 + kGap * labels.length),
  );
  const ruler_m = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05].find((m) => m * scale > 40) ?? 0.1;
  return html`<svg
    ref=${place}
    class="section"
    viewBox=${`0 0 ${width} ${Math.max(height, slots.at(-1) ?? 0) + 8}`}
    role="img"
    aria-label=${label}
  >
    <clipPath id="section-clip"><rect x="0" y="0" width=${edge} height=${height} /></clipPath>
    <rect class="section-air" x="0" y="0" width=${edge} height=${height} />
    <g clip-path="url(#section-clip)">
      ${lines.map(
        (line, i) =>
          line.length > 1 &&
          html`<polygon points=${area(line)} fill=${tissueColor(layers[i].tissue)} class="section-layer" />`,
      )}
      ${all.map(
        (shape, i) =>
          html`<clipPath id=${`target-clip-${i}`}>${bandsOf(shape).map((points) => html`<polygon points=${points} />`)}</clipPath>
            <g clip-path=${shape.tissues.length > 0 ? `url(#target-clip-${i})` : undefined}>
              <${Shape} shape=${shape} x=${x} y=${y} scale=${scale} />
            </g>`,
      )}
      <${ShapeLabels} shapes=${all} x=${x} y=${y} scale=${scale} />
      ${over?.({ x, y, scale })}
    </g>
    ${labels.map(
      (l, i) =>
        html`
          <circle class="leader-dot" cx=${l.x} cy=${l.y} r="2" />
          <polyline class="leader" points=${`${l.x},${l.y} ${edge + 8},${slots[i]} ${edge + 16},${slots[i]}`} />
          <text x=${edge + 19} y=${slots[i] + 4}>${l.text}</text>
        `,
    )}
    <g class="ruler">
      <line x1="10" y1=${height - 10} x2=${10 + ruler_m * scale} y2=${height - 10} />
      <text x="10" y=${height - 15}>${quantity(ruler_m, 'm')}</text>
    </g>
  </svg>`;
}

/** The view from above, along the needle's way in. */
export function TopView({ profile, frame, label, half_m = 0.03, over }) {
  const size = 300,
    scale = size / 2 / half_m;
  const x = (u) => size / 2 + u * scale,
    y = (v) => size / 2 - v * scale;
  const all = shapes(profile, frame, 'v');
  const skin = layerBounds(profile)[0]?.tissue;
  return html`<svg class="section" viewBox=${`0 0 ${size} ${size}`} role="img" aria-label=${label}>
    <rect x="0" y="0" width=${size} height=${size} fill=${tissueColor(skin)} />
    ${all.map((shape) => html`<${Shape} shape=${shape} x=${x} y=${y} scale=${scale} />`)}
    <path class="cross" d=${`M0 ${size / 2}H${size}M${size / 2} 0V${size}`} />
    ${over?.({ x, y, scale })}
    <g class="ruler">
      <line x1="10" y1=${size - 10} x2=${10 + 0.01 * scale} y2=${size - 10} />
      <text x="10" y=${size - 15}>10 mm</text>
    </g>
  </svg>`;
}

/** The legend of the drawings. */
export function Legend({ profile, path }) {
  return html`<ul class="drawing-legend">
    ${
      path &&
      html`<li>
        <svg viewBox="0 0 24 12" aria-hidden="true"><path class="tip-path" d="M1 10C8 2 14 2 23 8" /></svg>path of the
        tip
      </li>`
    }
    ${
      (profile.targets ?? []).length > 0 &&
      html`<li>
        <svg viewBox="0 0 24 12" aria-hidden="true">
          <circle class="shape-target" cx="12" cy="6" r="5" />
        </svg>target: ${profile.targets.map((t) => t.name).join(', ')}
      </li>`
    }
    ${
      (profile.hazards ?? []).length > 0 &&
      html`<li>
        <svg viewBox="0 0 24 12" aria-hidden="true">
          <circle class="shape-hazard" cx="12" cy="6" r="5" />
        </svg>hazard: ${profile.hazards.map((h) => `${h.name} (${words(h.kind)})`).join(', ')}
      </li>`
    }
  </ul>`;
}

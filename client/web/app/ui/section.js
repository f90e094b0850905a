// A cut through the limb, to scale: layers with their names, targets, hazards. A page can draw over it.
import { regionWords } from '../lib/body.js';
import { depthOf, frameOf, inFrame, layerBounds, layerLabels, levelLine, placed } from '../lib/scene.js';
import { tissueColor } from '../lib/tissue.js';
import { beside, Cut, Entry, kSigns, Ruler, Shape, Shapes, shapesOf } from './cut.js';
import { useWidth } from './hooks.js';
import { html, useMemo } from './html.js';

const kWidth = 640,
  kLabels = 185,
  kTop_m = 0.012,
  kHeight = 440;

/** A place of a frame in the two views: w is down in one, up in the other. */
const sideways = ({ u, v, d }) => ({ u, w: d, v }),
  fromAbove = ({ u, v }) => ({ u, w: v, v });

/**
 * The side view.
 * @param {{profile: any, frame?: any, fidelity?: (number|null)[], to_m?: number, height_px?: number, label: string, over?: (at: {x: (u: number) => number, y: (d: number) => number, scale: number}) => any}} props
 *   `over` draws in pixels on top
 */
export function SideView({ profile, frame: given, fidelity, to_m, height_px = kHeight, label, over }) {
  // drawn at the element's own width: letters keep their size
  const [place, room] = useWidth(kWidth);
  const width = Math.max(320, room);
  const drawn = useMemo(() => {
    const layers = layerBounds(profile),
      frame = given ?? frameOf(profile.limb),
      depth = depthOf(profile.limb);
    const bottom_m = Math.max(0.01, to_m ?? 0, layers.at(-1)?.to_m ?? 0),
      height_m = bottom_m + kTop_m;
    const { texts, width_px } = layerLabels(layers, fidelity, kLabels, Math.max(kLabels, width / 2));
    const scale = Math.min(height_px / height_m, (width - width_px) / 0.02);
    const half_m = (width - width_px) / scale / 2;
    const window = { from_u: -half_m, to_u: half_m, from_d: -kTop_m, to_d: bottom_m };
    const lines = layers.map((l) => levelLine(depth, frame, l.from_m, window));
    const shapes = shapesOf(placed(profile), (p) => sideways(inFrame(frame, p)), true);
    return { layers, bottom_m, scale, half_m, height: height_m * scale, lines, shapes, texts };
    // the numbers, because the page makes a new list each time
  }, [profile, given, to_m, width, height_px, fidelity?.join()]);
  const { texts, layers, scale, half_m, height, lines, shapes, bottom_m } = drawn;
  const x = (u) => (u + half_m) * scale,
    y = (d) => (d + kTop_m) * scale;
  const corner = (u, d) => `${x(u).toFixed(1)},${y(d).toFixed(1)}`;
  const area = (line) =>
    [...line.map((p) => corner(p.u, p.d)), corner(line.at(-1).u, bottom_m), corner(line[0].u, bottom_m)].join(' ');
  const bandsOf = (tissues) =>
    layers.map((layer, i) => {
      if (!tissues.includes(layer.name) || lines[i].length < 2) return '';
      const below =
        (lines[i + 1]?.length ?? 0) > 1
          ? lines[i + 1]
          : [
              { u: -half_m, d: bottom_m },
              { u: half_m, d: bottom_m },
            ];
      return html`<polygon points=${[...lines[i], ...below.toReversed()].map((p) => corner(p.u, p.d)).join(' ')} />`;
    });
  const edge = x(half_m);
  // all leader lines begin in one column that crosses every layer, as far right as possible, in the order of the layers
  const ends = lines.map((line) => line.filter((p) => p.d < bottom_m * 0.98).at(-1)?.u ?? 0);
  const column = Math.max(0, Math.min(half_m * 0.985, ...ends.map((u) => (u >= half_m - 1e-9 ? half_m : u * 0.85))));
  const top = (i) =>
    lines[i]?.reduce((best, p) => (best && Math.abs(best.u - column) <= Math.abs(p.u - column) ? best : p), null)?.d ??
    bottom_m;
  const seen = (i) => ({ u: column, d: (top(i) + Math.max(top(i), i + 1 < lines.length ? top(i + 1) : bottom_m)) / 2 });
  const names = beside(
    layers.map((_, i) => {
      const at = seen(i);
      return { x: x(at.u), y: y(at.d), text: texts[i] };
    }),
    height,
  );
  const ruler_m = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05].find((m) => m * scale > 40) ?? 0.1;
  return html`<${Cut} place=${place} width=${width} height=${height} edge=${edge} names=${names} label=${label}>
    <clipPath id="section-clip"><rect x="0" y="0" width=${edge} height=${height} /></clipPath>
    <g clip-path="url(#section-clip)">
      ${lines.map(
        (line, i) =>
          line.length > 1 &&
          html`<polygon points=${area(line)} fill=${tissueColor(layers[i].tissue)} class="section-layer" />`,
      )}
      <${Shapes} shapes=${shapes} areaOf=${bandsOf} x=${x} y=${y} scale=${scale} />
      ${over?.({ x, y, scale })}
    </g>
    <${Ruler} length_m=${ruler_m} scale=${scale} height=${height} />
  <//>`;
}

/** The view from above, along the needle's way in. */
export function TopView({ profile, frame, label, half_m = 0.03, over }) {
  const size = 300,
    scale = size / 2 / half_m;
  const x = (u) => size / 2 + u * scale,
    y = (v) => size / 2 - v * scale;
  const shapes = shapesOf(placed(profile), (p) => fromAbove(inFrame(frame, p)), false);
  const skin = layerBounds(profile)[0]?.tissue;
  return html`<svg class="section" viewBox=${`0 0 ${size} ${size}`} role="img" aria-label=${label}>
    <rect x="0" y="0" width=${size} height=${size} fill=${tissueColor(skin)} />
    ${shapes.map((shape) => html`<${Shape} shape=${shape} x=${x} y=${y} scale=${scale} />`)}
    <path class="cross" d=${`M0 ${size / 2}H${size}M${size / 2} 0V${size}`} />
    ${over?.({ x, y, scale })}
    <${Ruler} length_m=${0.01} scale=${scale} height=${size} />
  </svg>`;
}

/** The legend of the drawings; `path` and `cap`: of a needle in them. */
export function Legend({ profile, path, cap }) {
  const row = (kind, regions) =>
    regions?.length > 0 &&
    html`<li>
      <svg viewBox="0 0 24 12" aria-hidden="true"><circle class=${`shape-${kind}`} cx="12" cy="6" r="5" /></svg>
      ${profile.volume ? `${kSigns[kind]} ` : ''}${kind}: ${regions.map((r) => regionWords(profile, r)).join(', ')}
    </li>`;
  return html`<ul class="drawing-legend">
    ${
      path &&
      html`<li>
        <svg viewBox="0 0 24 12" aria-hidden="true"><path class="tip-path" d="M1 10C8 2 14 2 23 8" /></svg>path of the
        tip
      </li>`
    }
    ${
      cap &&
      html`<li>
        <svg viewBox="0 0 24 12" aria-hidden="true"><circle class="tip-cap" cx="12" cy="6" r="5" /></svg>tip, capped
      </li>`
    }
    ${
      profile.volume &&
      html`<li>
        <svg viewBox="0 0 24 12" aria-hidden="true"><${Entry} x=${12} y=${11} /></svg>place of insertion
      </li>`
    }
    ${row('target', profile.targets)}
    ${row('hazard', profile.hazards)}
  </ul>`;
}

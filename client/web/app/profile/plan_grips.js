// The planned line in a body's section, from the place of insertion to the first target; both can be dragged.
import { entryIn, fromSection, inSection } from '../lib/body.js';
import { html, useState } from '../ui/html.js';

const kGrip_px = 9;

/** Where a planned line begins and ends, in the profile's frame; null: no skin or no target's point. */
export function planOf(profile, section) {
  const at = section && entryIn(section),
    target_m = profile.targets?.[0]?.center_m;
  if (!at || !target_m) return null;
  const entry_m = fromSection(section, at),
    way = ['x', 'y', 'z'].map((axis) => (Number(target_m[axis]) || 0) - entry_m[axis]),
    length_m = Math.hypot(...way);
  const off = Math.acos(Math.min(1, -section.upward.reduce((sum, k, i) => sum + k * way[i], 0) / length_m));
  return { entry_m, target_m, length_m, off_normal_rad: off, direction: way.map((v) => v / length_m) };
}

/**
 * @param {{section: any, target_m: any, scale: number, onTarget?: (point_m: any) => void, onEntry?: (point_m: any) => void}} props
 *   `scale`: pixels of a metre; without functions nothing can be dragged
 */
export function PlanGrips({ section, target_m, scale, onTarget, onEntry }) {
  const [dragged, setDragged] = useState(null);
  const aim = inSection(section, target_m);
  const places = { entry: entryIn(section), target: aim };
  if (dragged) places[dragged.what] = dragged;
  const { entry, target } = places;
  if (!entry) return null;
  const place = (event, what) => {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(
      event.currentTarget.ownerSVGElement.getScreenCTM().inverse(),
    );
    if (what === 'target') return { what, moved: true, u: x / scale, w: y / scale };
    const skin = entryIn(section, Math.floor(x / scale / section.point_m) + 0.5);
    return skin && { what, moved: true, ...skin };
  };
  const grip = (what, { u, w }, words, done) =>
    done &&
    html`<circle
      class="grip"
      data-grip=${what}
      cx=${u * scale}
      cy=${w * scale}
      r=${kGrip_px}
      onPointerDown=${(event) => {
        event.currentTarget.setPointerCapture(event.pointerId);
        setDragged({ what, u, w });
      }}
      onPointerMove=${(event) => dragged && setDragged(place(event, what) ?? dragged)}
      onPointerCancel=${() => setDragged(null)}
      onPointerUp=${(event) => {
        const end = dragged?.moved && place(event, what);
        setDragged(null);
        if (end) done(fromSection(section, { ...end, v: what === 'target' ? aim.v : 0 }));
      }}
    ><title>${words}</title></circle>`;
  return html`<line
      class="plan-line"
      x1=${entry.u * scale}
      y1=${entry.w * scale}
      x2=${target.u * scale}
      y2=${target.w * scale}
    />
    ${grip('entry', entry, 'Place of insertion: drag it along the skin', onEntry)}
    ${grip('target', target, 'Target: drag it', onTarget)}`;
}

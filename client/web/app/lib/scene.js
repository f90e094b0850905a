// The limb of a profile as geometry: depth under the skin, a frame at the place of insertion, a cut through it. Pure;
// metres.
import { layerNames } from './tissue.js';
import { atStart, number, quantity } from './units.js';

/** @typedef {{x: number, y: number, z: number}} Vec */

const vec = (p) => ({ x: Number(p?.x) || 0, y: Number(p?.y) || 0, z: Number(p?.z) || 0 });
export const add = (a, b, k = 1) => ({ x: a.x + k * b.x, y: a.y + k * b.y, z: a.z + k * b.z });
export const minus = (a, b) => add(a, b, -1);
export const dot = (a, b) => a.x * b.x + a.y * b.y + a.z * b.z;
export const cross = (a, b) => ({ x: a.y * b.z - a.z * b.y, y: a.z * b.x - a.x * b.z, z: a.x * b.y - a.y * b.x });
export const length = (a) => Math.sqrt(dot(a, a));
const scaled = (a, k) => ({ x: a.x * k, y: a.y * k, z: a.z * k });
/** `a` with length 1, or `instead` if it has none. */
export const unit = (a, instead) => (length(a) > 1e-12 ? scaled(a, 1 / length(a)) : instead);

function nearestOnSegment(p, a, b) {
  const along = minus(b, a);
  const square = dot(along, along);
  const t = square > 0 ? Math.max(0, Math.min(1, dot(minus(p, a), along) / square)) : 0;
  return add(a, along, t);
}

/**
 * Signed depth under the skin (common/haptics/FORCE_MODEL.md, "Contact"): negative outside.
 * @param {any} limb of a profile
 * @returns {(p: Vec) => number} NaN if it is not a limb
 */
export function depthOf(limb) {
  if (limb?.plane) {
    const point = vec(limb.plane.point_m),
      normal = unit(vec(limb.plane.normal), { x: 0, y: 0, z: 1 });
    return (p) => -dot(normal, minus(p, point));
  }
  if (limb?.sphere) {
    const center = vec(limb.sphere.center_m),
      radius = Number(limb.sphere.radius_m);
    return (p) => radius - length(minus(p, center));
  }
  if (limb?.capsule) {
    const a = vec(limb.capsule.a_m),
      b = vec(limb.capsule.b_m),
      radius = Number(limb.capsule.radius_m);
    return (p) => radius - length(minus(p, nearestOnSegment(p, a, b)));
  }
  return () => NaN;
}

/** The unit normal out of the body at the skin nearest to `p`; at a limb's centre, the frame's z. */
function normalAt(limb, p) {
  const up = { x: 0, y: 0, z: 1 };
  if (limb?.plane) return unit(vec(limb.plane.normal), up);
  const capsule = limb?.capsule;
  const center = capsule ? nearestOnSegment(p, vec(capsule.a_m), vec(capsule.b_m)) : vec(limb?.sphere?.center_m);
  return unit(minus(p, center), up);
}

/** The middle of a target or hazard. */
function middleOf(region) {
  const [from, to] = region.center_m ? [region.center_m, region.center_m] : [region.a_m, region.b_m];
  return scaled(add(vec(from), vec(to)), 0.5);
}

/**
 * Depth of a target's or hazard's middle under the top of a layer, in metres, rounded to a hundredth of a millimetre.
 */
export function offsetUnder(profile, region, layer) {
  const top_m = layerBounds(profile).find((l) => l.name === layer)?.from_m ?? 0,
    under_m = depthOf(profile.limb)(middleOf(region)) - top_m;
  return Number.isFinite(under_m) ? Math.round(under_m * 1e5) / 1e5 : 0;
}

/**
 * The profile with its targets and hazards where their anchors put them, as in common/profile/anchors.h; a region whose
 * anchor names no layer stays.
 */
export function placed(profile) {
  const layers = layerBounds(profile),
    names = layerNames(profile),
    depth = depthOf(profile?.limb);
  const move = (region) => {
    const layer = layers[names.indexOf(region?.anchor?.layer)];
    if (!layer) return region;
    const ends = region.center_m ? ['center_m'] : ['a_m', 'b_m'],
      middle = middleOf(region);
    const up = depth(middle) - (layer.from_m + (Number(region.anchor.offset_m) || 0));
    if (!Number.isFinite(up)) return region;
    const normal = normalAt(profile.limb, middle);
    return { ...region, ...Object.fromEntries(ends.map((end) => [end, add(vec(region[end]), normal, up)])) };
  };
  const all = (list) => (Array.isArray(list) ? list.map(move) : list);
  return { ...profile, targets: all(profile?.targets), hazards: all(profile?.hazards) };
}

/**
 * The place of insertion: the skin point nearest to the profile's origin; `n` points out, `e1` and `e2` along the skin.
 * @param {any} limb
 * @param {Vec} [near] another point than the origin, e.g. where a recording's needle entered
 * @param {Vec} [lean] the direction in the skin that e1 follows, e.g. the needle's; x if it has none
 * @returns {{o: Vec, n: Vec, e1: Vec, e2: Vec}}
 */
export function frameOf(limb, near = { x: 0, y: 0, z: 0 }, lean = { x: 1, y: 0, z: 0 }) {
  const up = { x: 0, y: 0, z: 1 };
  let n = up,
    o = { x: 0, y: 0, z: 0 };
  if (limb?.plane) {
    n = unit(vec(limb.plane.normal), up);
    o = add(near, n, -dot(n, minus(near, vec(limb.plane.point_m))));
  } else if (limb?.sphere || limb?.capsule) {
    const axis = limb.sphere ? null : { a: vec(limb.capsule.a_m), b: vec(limb.capsule.b_m) };
    const center = axis ? nearestOnSegment(near, axis.a, axis.b) : vec(limb.sphere.center_m);
    n = unit(minus(near, center), up);
    o = add(center, n, Number((limb.sphere ?? limb.capsule).radius_m) || 0);
  }
  const along = (v) => add(v, n, -dot(v, n));
  const first = along(lean);
  const e1 = unit(
    length(first) > 0.02 ? first : along({ x: 1, y: 0, z: 0 }),
    unit(along({ x: 0, y: 1, z: 0 }), { x: 0, y: 1, z: 0 }),
  );
  return { o, n, e1, e2: cross(n, e1) };
}

/**
 * A point in a frame: `u` along e1, `v` along e2, `d` down into the body.
 * @param {{o: Vec, n: Vec, e1: Vec, e2: Vec}} frame
 * @param {Vec} p
 */
export function inFrame({ o, n, e1, e2 }, p) {
  const r = minus(vec(p), o);
  return { u: dot(r, e1), v: dot(r, e2), d: -dot(r, n) };
}

const kInPlane_m = 0.001, // a shape nearer than this counts as in the side view's plane
  kHalved_m = 0.008; // this much farther, it is half as strong

/**
 * The distance of a ball or rounded line from the side view's plane (v = 0): positive behind it, negative in front, 0
 * where the plane cuts it.
 * @param {number} radius_m
 * @param {number} a_v coordinate of its middle, or of its ends
 * @param {number} [b_v]
 */
export function offPlane(radius_m, a_v, b_v = a_v) {
  const nearest = Math.min(a_v, b_v) - radius_m,
    farthest = Math.max(a_v, b_v) + radius_m;
  return nearest > 0 ? nearest : farthest < 0 ? farthest : 0;
}

/** How strongly a shape is drawn at that distance: 1 within 1 mm, then half for every 8 mm. */
export const offPlaneOpacity = (off_m) => 2 ** (-Math.max(0, Math.abs(off_m) - kInPlane_m) / kHalved_m);

/** "artery"; more than 1 mm off the plane "artery, 8 mm behind" or "…, 8 mm in front". */
export const offPlaneLabel = (name, off_m) =>
  Math.abs(off_m) > kInPlane_m
    ? `${name}, ${Math.round(Math.abs(off_m) * 1000)} mm ${off_m > 0 ? 'behind' : 'in front'}`
    : name;

/**
 * The line in the cut (u, d) through the frame on which the depth is `level`.
 * @param {(p: Vec) => number} depth
 * @param {{o: Vec, n: Vec, e1: Vec}} frame
 * @param {number} level
 * @param {{from_u: number, to_u: number, from_d: number, to_d: number, columns?: number}} window
 * @returns {{u: number, d: number}[]} columns without a crossing are omitted
 */
export function levelLine(depth, { o, n, e1 }, level, { from_u, to_u, from_d, to_d, columns = 60 }) {
  const line = [],
    kSteps = 80;
  for (let c = 0; c <= columns; c++) {
    const u = from_u + ((to_u - from_u) * c) / columns;
    const at = (d) => depth(add(add(o, e1, u), n, -d)) - level;
    let before = from_d;
    if (at(before) >= 0) {
      line.push({ u, d: before });
      continue;
    }
    for (let i = 1; i <= kSteps; i++) {
      const d = from_d + ((to_d - from_d) * i) / kSteps;
      if (at(d) >= 0) {
        let low = before,
          high = d;
        for (let k = 0; k < 24; k++) {
          const middle = (low + high) / 2;
          if (at(middle) >= 0) high = middle;
          else low = middle;
        }
        line.push({ u, d: high });
        break;
      }
      before = d;
    }
  }
  return line;
}

/** Names of the layers of a profile, and where they begin and end; a thickness that is not a number counts as 0. */
export function layerBounds(profile) {
  let from_m = 0;
  const names = layerNames(profile);
  return (profile.layers ?? []).map((layer, i) => {
    const thickness = Number(layer.thickness_m) > 0 ? Number(layer.thickness_m) : 0;
    const bounds = { name: names[i], tissue: layer.tissue ?? 'OTHER', from_m, to_m: from_m + thickness };
    from_m += thickness;
    return bounds;
  });
}

const kLetter_px = 7.5, // the width of a letter of 13 px, on the safe side: as in "mm" in a wide font
  kLeader_px = 24;

/**
 * The labels beside a cut, "Skin 3 mm, φ 0.93", and their width; cuts a name if `most_px` is too little.
 * @param {{name: string, from_m: number, to_m: number}[]} layers
 * @param {(number|null)[]|undefined} fidelity
 * @returns {{texts: string[], width_px: number}}
 */
export function layerLabels(layers, fidelity, least_px, most_px) {
  const names = layers.map((l) => atStart(l.name));
  const sizes = layers.map((l, i) => {
    const phi = fidelity?.[i];
    // a missing or invalid thickness has no size
    return ` ${l.to_m > l.from_m ? quantity(l.to_m - l.from_m, 'm') : '–'}${Number.isFinite(phi) ? `, φ ${number(phi, 2)}${phi < 0.5 ? ' !' : ''}` : ''}`;
  });
  const longest = Math.max(0, ...names.map((name, i) => name.length + sizes[i].length));
  const width_px = Math.min(most_px, Math.max(least_px, kLeader_px + longest * kLetter_px));
  const letters = Math.floor((width_px - kLeader_px) / kLetter_px + 1e-6);
  const cut = (name, room) => (name.length <= room ? name : `${name.slice(0, Math.max(1, room - 1))}…`);
  return { texts: names.map((name, i) => cut(name, letters - sizes[i].length) + sizes[i]), width_px };
}

/**
 * Heights at which labels do not overlap: each at its wish, or below those that it would cover.
 * @param {{x: number, y: number, width: number}[]} labels x: of the middle
 * @param {number} gap least distance of two lines
 * @returns {number[]}
 */
export function clearLabels(labels, gap) {
  const placed = [];
  // a label that was just moved may be nearer than the gap by a rounding error
  const covers = (a, b) => Math.abs(a.x - b.x) < (a.width + b.width) / 2 && Math.abs(a.y - b.y) < gap - 1e-6;
  for (const label of [...labels].sort((a, b) => a.y - b.y)) {
    const here = { ...label, of: label };
    // it only moves down, so it passes each placed label at most once
    for (let turn = 0; turn < placed.length; turn++) {
      const other = placed.find((p) => covers(p, here));
      if (!other) break;
      here.y = other.y + gap;
    }
    placed.push(here);
  }
  return labels.map((label) => placed.find((p) => p.of === label).y);
}

/** The needle's axis, hub to tip (+z of the tip's frame), of a quaternion. */
export function axisOf(qx, qy, qz, qw) {
  return { x: 2 * (qx * qz + qw * qy), y: 2 * (qy * qz - qw * qx), z: 1 - 2 * (qx * qx + qy * qy) };
}

/**
 * Heights of labels, each as near to its wish as possible and at least `gap` from the next.
 * @param {number[]} wishes ascending
 */
export function spread(wishes, gap, from, to) {
  const at = [...wishes];
  for (let i = 0; i < at.length; i++) at[i] = Math.max(at[i], i ? at[i - 1] + gap : from);
  for (let i = at.length - 1; i >= 0; i--) at[i] = Math.min(at[i], i === at.length - 1 ? to : at[i + 1] - gap);
  return at;
}

// The columns of a recording as plots and replays need them, and the position of a replay. Pure.
import { indexAt } from './decimate.js';
import { axisOf, depthOf, frameOf, inFrame } from './scene.js';

/** The columns of a reply of /samples by name, whether they are under `columns` or at the top. */
export function columnsOf(reply) {
  return reply?.columns ?? reply ?? {};
}

/** |force| of each sample, in N. The server's own if it sends one: decimated components are not of one moment. */
export function forceOf({ force_n, fx_n = [], fy_n = [], fz_n = [] }) {
  return force_n ?? fx_n.map((x, i) => Math.hypot(x, fy_n[i], fz_n[i]));
}

/**
 * Stretches of time in one layer, from the column `layer`.
 * @returns {{from: number, to: number, layer: number}[]} outside the tissue: none
 */
export function layerSpans({ t_s = [], layer = [] }) {
  const spans = [];
  for (let i = 0; i < t_s.length; i++) {
    const last = spans.at(-1);
    if (last && last.layer === layer[i]) last.to = t_s[i];
    else {
      if (last) last.to = t_s[i];
      spans.push({ from: t_s[i], to: t_s[i], layer: layer[i] });
    }
  }
  return spans.filter((s) => s.layer >= 0);
}

/**
 * A pose of a frame in W, as `placement` of a session: x y z qx qy qz qw; empty: identity.
 * @returns {(p: {x: number, y: number, z: number}, free?: boolean) => {x: number, y: number, z: number}} from W into the frame; `free`: a direction
 */
export function intoLimb(placement) {
  if (!Array.isArray(placement) || placement.length !== 7) return (p) => p;
  const [x, y, z, qx, qy, qz, qw] = placement;
  // the inverse rotation is that of the conjugate: v + 2 q × (q × v + w v)
  const rotate = (v) => {
    const a = -qx,
      b = -qy,
      c = -qz;
    const t = { x: b * v.z - c * v.y + qw * v.x, y: c * v.x - a * v.z + qw * v.y, z: a * v.y - b * v.x + qw * v.z };
    return { x: v.x + 2 * (b * t.z - c * t.y), y: v.y + 2 * (c * t.x - a * t.z), z: v.z + 2 * (a * t.y - b * t.x) };
  };
  return (p, free) => rotate(free ? p : { x: p.x - x, y: p.y - y, z: p.z - z });
}

/**
 * The way of the tip in the frame of its first insertion: the side view's plane holds the skin's normal and the needle.
 * @param {Record<string, number[]>} columns
 * @param {any} profile
 * @param {number[]} [placement]
 */
export function wayOf(columns, profile, placement) {
  const limb = intoLimb(placement),
    depth = depthOf(profile.limb),
    n = columns.t_s?.length ?? 0;
  const points = [],
    axes = [];
  for (let i = 0; i < n; i++) {
    points.push(limb({ x: columns.px_m[i], y: columns.py_m[i], z: columns.pz_m[i] }));
    axes.push(
      columns.qx
        ? limb(axisOf(columns.qx[i], columns.qy[i], columns.qz[i], columns.qw[i]), true)
        : { x: 0, y: 0, z: -1 },
    );
  }
  const first = points.findIndex((p) => depth(p) > 0);
  const entry =
    first < 0
      ? Math.max(
          0,
          points.reduce((best, p, i) => (depth(p) > depth(points[best]) ? i : best), 0),
        )
      : first;
  const frame = frameOf(profile.limb, points[entry], axes[entry]);
  const flat = points.map((p) => inFrame(frame, p));
  const still = { ...frame, o: { x: 0, y: 0, z: 0 } };
  const leans = axes.map((a) => inFrame(still, a));
  return {
    frame,
    t_s: columns.t_s ?? [],
    points: flat,
    axes: leans,
    deepest_m: Math.max(0, ...flat.map((p) => p.d).filter(Number.isFinite)),
  };
}

/** The event's name for people. */
export const kBoneContact = 'bone contact';
/** Out of bone for so long, the tip can make another contact: common/scoring/bone_contacts.h. */
const kBoneAway_s = 0.2;

/** Distance of p from the segment a-b, which may be a point. */
function segmentDistance(p, a, b) {
  const d = { x: b.x - a.x, y: b.y - a.y, z: b.z - a.z };
  const square = d.x * d.x + d.y * d.y + d.z * d.z;
  const along = square > 0 ? ((p.x - a.x) * d.x + (p.y - a.y) * d.y + (p.z - a.z) * d.z) / square : 0;
  const s = Math.max(0, Math.min(1, along));
  return Math.hypot(p.x - a.x - s * d.x, p.y - a.y - s * d.y, p.z - a.z - s * d.z);
}

/**
 * When the tip came into bone, a layer or a hazard, by the rule of the measure bone_contacts. Between two points of a
 * decimated recording nothing is known: the score's row has the number of contacts.
 * @param {Record<string, number[]>} columns
 * @param {any} profile
 * @param {number[]} [placement]
 * @returns {number[]} s
 */
export function boneContacts(columns, profile, placement) {
  const limb = intoLimb(placement),
    bones = (profile?.hazards ?? []).filter((h) => h.kind === 'BONE');
  const isIn = (i) => {
    const layer = columns.layer[i];
    if (!(layer >= 0)) return false;
    if (profile.layers?.[layer]?.tissue === 'BONE') return true;
    const p = limb({ x: columns.px_m?.[i], y: columns.py_m?.[i], z: columns.pz_m?.[i] });
    return bones.some((h) => segmentDistance(p, h.a_m ?? h.center_m, h.b_m ?? h.center_m) <= h.radius_m);
  };
  const found = [];
  let touching = false,
    away_since_s = null;
  for (let i = 0; profile && columns.layer && i < (columns.t_s?.length ?? 0); i++) {
    const t = columns.t_s[i];
    if (!isIn(i)) {
      if (touching) away_since_s ??= t;
      continue;
    }
    if (!touching || (away_since_s !== null && t - away_since_s >= kBoneAway_s * (1 - 1e-9))) found.push(t);
    touching = true;
    away_since_s = null;
  }
  return found;
}

/**
 * What is said of the contacts with bone. The score counts them over all samples; moments are known only where the
 * points of the plot show them, which can be fewer.
 * @param {any[]|undefined} measures of the score, if there is one
 * @param {number} shown how many moments the points show
 * @returns {{many: string, moments: string}|null} `many`: how many there were, empty without a score; null: none
 */
export function boneContactWords(measures, shown) {
  const counted = measures?.find((row) => row.measure === 'bone_contacts')?.value;
  const known = Number.isFinite(counted);
  if (shown === 0 && !(known && counted > 0)) return null;
  const many = known ? (counted === 1 ? `1 ${kBoneContact}` : `${counted} contacts with bone`) : '';
  if (known && shown === 0) return { many, moments: 'too short for the plot' };
  const short = known && counted > shown ? `, ${counted - shown} too short for the plot` : '';
  return { many, moments: `${known ? 'moments' : `moments of ${kBoneContact}`} that are shown${short}` };
}

/** Index of the sample at a moment. */
export const sampleAt = (way, at_s) => indexAt(way.t_s, at_s);

/** @typedef {{at_s: number, playing: boolean, speed: number, from_s: number, to_s: number, wanted_s?: number}} Playback */

export const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 4];

/** @returns {Playback} */
export const atRest = (from_s, to_s) => ({ at_s: from_s, playing: false, speed: 1, from_s, to_s });

const within = (p, at_s) => Math.max(p.from_s, Math.min(p.to_s, at_s));

/** Before the recording is there, keeps the moment that is wanted. @param {Playback} p */
export const seek = (p, at_s) => ({ ...p, at_s: within(p, at_s), wanted_s: p.from_s < p.to_s ? undefined : at_s });

/** Another recording, or the first: goes to the moment that was wanted meanwhile. @param {Playback} p */
export const loaded = (p, from_s, to_s) => seek(atRest(from_s, to_s), p.wanted_s ?? from_s);

/** Playing at the end begins again. */
export const toggle = (p) => ({ ...p, playing: !p.playing, at_s: !p.playing && p.at_s >= p.to_s ? p.from_s : p.at_s });

/** `elapsed_s` of the wall clock later; stops at the end. */
export function advance(p, elapsed_s) {
  if (!p.playing) return p;
  const at_s = within(p, p.at_s + elapsed_s * p.speed);
  return { ...p, at_s, playing: at_s < p.to_s };
}

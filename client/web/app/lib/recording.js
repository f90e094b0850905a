// The columns of a recording as plots and replays need them, and the position of a replay. Pure.
import { inSection } from './body.js';
import { indexAt } from './decimate.js';
import { kMeasures } from './measure_rows.js';
import { add, axisOf, depthOf, frameOf, inFrame, placed } from './scene.js';
import { clock } from './time.js';
import { hazardKindOf, profileLayers, tissueOf } from './tissue.js';
import { quantity } from './units.js';

/** The columns of a reply of /samples by name, whether they are under `columns` or at the top. */
export function columnsOf(reply) {
  return reply?.columns ?? reply ?? {};
}

/** |force| of each sample, in N. Prefers the server's own, because decimated components are not of one moment. */
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
 * A pose of a frame in W, like `placement` of a session: x y z qx qy qz qw; empty: identity.
 * @returns {(p: {x: number, y: number, z: number}, free?: boolean) => {x: number, y: number, z: number}} from W into the frame; `free`: a direction
 */
export function intoLimb(placement) {
  if (!Array.isArray(placement) || placement.length !== 7) return (p) => p;
  const [x, y, z, qx, qy, qz, qw] = placement;
  // the conjugate gives the inverse rotation: v + 2 q × (q × v + w v)
  const rotate = (v) => {
    const a = -qx,
      b = -qy,
      c = -qz;
    const t = { x: b * v.z - c * v.y + qw * v.x, y: c * v.x - a * v.z + qw * v.y, z: a * v.y - b * v.x + qw * v.z };
    return { x: v.x + 2 * (b * t.z - c * t.y), y: v.y + 2 * (c * t.x - a * t.z), z: v.z + 2 * (a * t.y - b * t.x) };
  };
  return (p, free) => rotate(free ? p : { x: p.x - x, y: p.y - y, z: p.z - z });
}

/** The tip's points and the needle's axes, in the profile's frame. */
function posesOf(columns, placement) {
  const limb = intoLimb(placement),
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
  return { points, axes };
}

/**
 * The tip's path in the frame of its first insertion: the side view's plane holds the skin's normal and the needle.
 * @param {Record<string, number[]>} columns
 * @param {any} profile with a limb
 * @param {number[]} [placement]
 */
export function wayOf(columns, profile, placement) {
  const depth = depthOf(profile.limb),
    { points, axes } = posesOf(columns, placement);
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

/**
 * The tip's path in the cut of a body, which has the places of `inSection`.
 * @param {Record<string, number[]>} columns
 * @param {any} section ProfileSection
 * @param {number[]} [placement]
 */
export function wayInSection(columns, section, placement) {
  const { points, axes } = posesOf(columns, placement);
  const at = points.map((p) => inSection(section, p));
  const leans = axes.map((axis, i) => {
    const ahead = inSection(section, add(points[i], axis));
    return { u: ahead.u - at[i].u, w: ahead.w - at[i].w, v: ahead.v - at[i].v };
  });
  return { t_s: columns.t_s ?? [], points: at, axes: leans };
}

/** How long a contact must be over before the next one can begin: common/scoring/anatomy/contacts.h. */
const kContactAway_s = 0.2;

/** Distance of p from the segment a-b, which may be a point. */
function segmentDistance(p, a, b) {
  const d = { x: b.x - a.x, y: b.y - a.y, z: b.z - a.z };
  const square = d.x * d.x + d.y * d.y + d.z * d.z;
  const along = square > 0 ? ((p.x - a.x) * d.x + (p.y - a.y) * d.y + (p.z - a.z) * d.z) / square : 0;
  const s = Math.max(0, Math.min(1, along));
  return Math.hypot(p.x - a.x - s * d.x, p.y - a.y - s * d.y, p.z - a.z - s * d.z);
}

/**
 * Least distance between the segments p-q and a-b: by ternary search, because the distance along one of them is convex.
 */
function segmentsDistance(p, q, a, b) {
  const at = (s) =>
    segmentDistance({ x: p.x + s * (q.x - p.x), y: p.y + s * (q.y - p.y), z: p.z + s * (q.z - p.z) }, a, b);
  let low = 0,
    high = 1;
  for (let i = 0; i < 40; i++) {
    const third = (high - low) / 3;
    if (at(low + third) < at(high - third)) high -= third;
    else low += third;
  }
  return Math.min(at(0), at(1), at((low + high) / 2));
}

/** When contacts begin, in s, by the rule of the measures. @param {number[]} t_s @param {(i: number) => boolean} touches */
function beginnings(t_s, touches) {
  const found = [];
  let touching = false,
    away_since_s = null;
  t_s.forEach((t, i) => {
    if (!touches(i)) {
      if (touching) away_since_s ??= t;
      return;
    }
    if (!touching || (away_since_s !== null && t - away_since_s >= kContactAway_s * (1 - 1e-9))) found.push(t);
    touching = true;
    away_since_s = null;
  });
  return found;
}

/** Hazards of bone, or all others: shapes, and the indices of those that are structures. */
function hazardsOf(profile, of_bone) {
  const hazards = (placed(profile).hazards ?? []).filter((h) => (hazardKindOf(profile, h) === 'BONE') === of_bone);
  const ids = (profile.volume?.structures ?? []).map((s) => s.id);
  return {
    shapes: hazards.filter((h) => !h.structure),
    structures: hazards.filter((h) => h.structure).map((h) => ids.indexOf(h.structure)),
  };
}

/** Whether the tip is in bone (a layer or a hazard) at a sample. */
function inBone(columns, profile, placement) {
  const limb = intoLimb(placement),
    { shapes: bones, structures } = hazardsOf(profile, true),
    tissues = profile.volume ? profile.volume.structures.map(tissueOf) : profileLayers(profile).map((l) => l?.tissue);
  return (i) => {
    const layer = columns.layer?.[i];
    if (!(layer >= 0)) return false;
    if (tissues[layer] === 'BONE' || structures.includes(layer)) return true;
    const p = limb({ x: columns.px_m?.[i], y: columns.py_m?.[i], z: columns.pz_m?.[i] });
    return bones.some((h) => segmentDistance(p, h.a_m ?? h.center_m, h.b_m ?? h.center_m) <= h.radius_m);
  };
}

/**
 * Whether the needle is in one of the structures at each sample: the shaft is where the tip came in, until it is drawn
 * back.
 */
function needleIn(structures, { layer = [], insertion_m = [] }) {
  let top_m = Infinity; // insertion at which the tip came in
  return layer.map((index, i) => {
    const now_m = insertion_m[i] ?? 0;
    if (!(index >= 0)) top_m = Infinity;
    else if (structures.includes(index)) top_m = Math.min(top_m, now_m);
    else if (now_m < top_m) top_m = Infinity;
    return now_m >= top_m;
  });
}

/** Whether the tip or the shaft in tissue touches a hazard other than bone. */
function inHazard(columns, profile, placement) {
  const limb = intoLimb(placement),
    { shapes: hazards, structures } = hazardsOf(profile, false),
    in_structure = needleIn(structures, columns);
  return (i) => {
    if (in_structure[i]) return true;
    if (hazards.length === 0 || !(columns.layer?.[i] >= 0) || !columns.qx) return false;
    const tip = limb({ x: columns.px_m[i], y: columns.py_m[i], z: columns.pz_m[i] }),
      axis = limb(axisOf(columns.qx[i], columns.qy[i], columns.qz[i], columns.qw[i]), true),
      back_m = columns.insertion_m?.[i] ?? 0;
    const skin = { x: tip.x - back_m * axis.x, y: tip.y - back_m * axis.y, z: tip.z - back_m * axis.z };
    return hazards.some((h) => segmentsDistance(tip, skin, h.a_m ?? h.center_m, h.b_m ?? h.center_m) <= h.radius_m);
  };
}

/**
 * The kinds of contacts: the measure that counts them, and the event's name. A new kind is one row.
 */
const kContacts = [
  { measure: kMeasures.bone, name: 'bone contact', at: inBone },
  {
    measure: kMeasures.hub,
    name: 'hub on the skin',
    at: (columns, profile) => (i) => columns.insertion_m?.[i] > profile.needle?.length_m,
  },
  { measure: kMeasures.hazard, name: 'hazard touched', at: inHazard },
];

/** @typedef {{measure: string, name: string, moments_s: number[]}} ContactsOfKind */

/**
 * When the tip came into bone, the hub onto the skin, and the needle to a hazard, by the rule of the measures. Nothing
 * is known between two points of a decimated recording; the score's rows have the numbers of contacts.
 * @param {Record<string, number[]>} columns
 * @param {any} profile
 * @param {number[]} [placement]
 * @returns {ContactsOfKind[]}
 */
export function contactsOf(columns, profile, placement) {
  return kContacts.map(({ at, ...kind }) => ({
    ...kind,
    moments_s: profile ? beginnings(columns.t_s ?? [], at(columns, profile, placement)) : [],
  }));
}

/**
 * The words before the moments of one kind of contacts. The score counts them over all samples; moments are known only
 * if the points of the plot show them, which can be fewer.
 * @param {any[]|undefined} measures of the score, if there is one
 * @param {ContactsOfKind} contacts
 * @returns {string|null} null: none
 */
export function contactWords(measures, { measure, name, moments_s: { length: shown } }) {
  const hidden = (measures?.find((row) => row.measure === measure)?.value ?? 0) - shown;
  if (shown === 0) return hidden > 0 ? `${name}, too short for the plot` : null;
  return hidden > 0 ? `${name} (${hidden} more too short for the plot):` : `${name}:`;
}

/** Whether the needle has its cap on at a sample. */
export const isCapped = ({ capped }, i) => capped?.[i] > 0;

/** "0:04.2: in fat, 12 mm deep, 1.3 N": the moment of a sample. */
export function momentWords(columns, i, at_s, names, force_n) {
  const layer = columns.layer?.[i] ?? -1,
    name = names[layer] ?? `layer ${layer + 1}`;
  const where = layer >= 0 ? `in ${name}, ${quantity(columns.insertion_m?.[i], 'm')} deep` : 'outside';
  return `${clock(at_s)}: ${where}${isCapped(columns, i) ? ', capped' : ''}, ${quantity(force_n, 'N')}`;
}

/** Index of the sample at a moment. */
export const sampleAt = ({ t_s }, at_s) => indexAt(t_s, at_s);

/** @typedef {{at_s: number, playing: boolean, speed: number, from_s: number, to_s: number, wanted_s?: number}} Playback */

export const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 4];

/** @returns {Playback} */
export const atRest = (from_s, to_s) => ({ at_s: from_s, playing: false, speed: 1, from_s, to_s });

const within = (p, at_s) => Math.max(p.from_s, Math.min(p.to_s, at_s));

/** Before the recording is there, keeps the wanted moment. @param {Playback} p */
export const seek = (p, at_s) => ({ ...p, at_s: within(p, at_s), wanted_s: p.from_s < p.to_s ? undefined : at_s });

/** Another recording, or the first: goes to the moment wanted meanwhile. @param {Playback} p */
export const loaded = (p, from_s, to_s) => seek(atRest(from_s, to_s), p.wanted_s ?? from_s);

/** Playing at the end begins again. */
export const toggle = (p) => ({ ...p, playing: !p.playing, at_s: !p.playing && p.at_s >= p.to_s ? p.from_s : p.at_s });

/** `elapsed_s` of the wall clock later; stops at the end. */
export function advance(p, elapsed_s) {
  if (!p.playing) return p;
  const at_s = within(p, p.at_s + elapsed_s * p.speed);
  return { ...p, at_s, playing: at_s < p.to_s };
}

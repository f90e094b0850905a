// A stored body of another build, fat, size or side: its shapes, rules, targets and hazards, from the document alone.
// Pure; metres.
import { isObject } from './shape.js';
import { kindOf } from './tissue.js';

const kPoints = ['at_m', 'a_m', 'b_m', 'point_m', 'center_m'],
  kDirections = ['x_axis', 'y_axis', 'normal', 'direction'],
  kLengths = ['radius_m', 'radius_a_m', 'radius_b_m', 'radii_m', 'blend_m', 'from_m', 'to_m', 'pulse_m', 'offset_m'];
const kAxes = ['x', 'y', 'z'];
const kLeast = 0.4; // of its radius keeps a finger when fat is taken away
const kFits = 0.05; // of a body's lengths may differ from its family's

/** To a nanometre, so that sums do not collect digits; what is no number stays as it is. */
const rounded = (value) => (typeof value === 'number' ? Math.round(value * 1e9) / 1e9 : value);
const each = (value, change) =>
  isObject(value)
    ? Object.fromEntries(Object.entries(value).map(([axis, v]) => [axis, change(v, axis)]))
    : change(value);

/** A copy with each number of the geometry changed: `point` and `direction` by axis, `length`. */
function mapped(value, by, name = '') {
  const change =
    (kPoints.includes(name) && by.point) ||
    (kDirections.includes(name) && by.direction) ||
    (kLengths.includes(name) && by.length);
  if (change) return each(value, (v, axis) => rounded(typeof v === 'number' ? change(v, axis) : v));
  if (Array.isArray(value)) return value.map((item) => mapped(item, by));
  if (!isObject(value)) return value;
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, mapped(item, by, key)]));
}
const changed = (profile, by) => ({
  ...profile,
  ...Object.fromEntries(
    ['volume', 'targets', 'hazards'].filter((k) => profile[k]).map((k) => [k, mapped(profile[k], by)]),
  ),
});

/** Every length times `size`; the place of insertion, the origin, stays. */
export const scaled = (profile, size) => changed(profile, { point: (v) => v * size, length: (v) => v * size });

/** Moved by a vector: with minus a point of the skin, that is where the needle enters. */
export const shifted = (profile, way) => changed(profile, { point: (v, axis) => v + way[axis] });

/** Across which axis a body is mirrored: the one named left and right, else one that leaves the planned line in place. */
export function mirrorAxis({ directions, targets }) {
  const { x = 0, y = 0 } = targets?.[0]?.center_m ?? {};
  const sided = ['x', 'y'].find((axis) =>
    kSide.test(`${directions?.[`plus_${axis}`]} ${directions?.[`minus_${axis}`]}`),
  );
  return sided ?? (Math.abs(y) <= Math.abs(x) ? 'y' : 'x');
}

const kSide = /\b(left|right)\b/i;
const otherSide = (text) =>
  text.replace(/\b(left|right)\b/gi, (word) => {
    const other = word.toLowerCase() === 'left' ? 'right' : 'left';
    return word[0] === word[0].toUpperCase() ? other[0].toUpperCase() + other.slice(1) : other;
  });
/** Names with left and right exchanged; ids stay. */
function renamed(value, name = '') {
  if (typeof value === 'string') return ['name', 'layer', 'tissues'].includes(name) ? otherSide(value) : value;
  if (Array.isArray(value)) return value.map((item) => renamed(item, name));
  if (!isObject(value)) return value;
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, renamed(item, key)]));
}

const kTurned = { x: ' Mirrored: +x and −x are exchanged.', y: ' Mirrored: +y and −y are exchanged.' };

/** The other side of the body: its shapes, the names of its directions, and left and right in all names. */
export function mirrored(profile, axis = mirrorAxis(profile)) {
  const flip = (v, of) => (of === axis && v ? -v : v),
    made = renamed(changed(profile, { point: flip, direction: flip })),
    old = profile.directions ?? {};
  const ways = kAxes.flatMap((of) => [
    [`plus_${of}`, `${of === axis ? 'minus' : 'plus'}_${of}`],
    [`minus_${of}`, `${of === axis ? 'plus' : 'minus'}_${of}`],
  ]);
  if (profile.directions)
    made.directions = Object.fromEntries(
      ways.filter(([, from]) => old[from]).map(([way, from]) => [way, otherSide(old[from])]),
    );
  if (typeof made.description === 'string') {
    made.description = made.description.replace(/^(left|right)\b/i, otherSide);
    if (!kSide.test(`${old[`plus_${axis}`]} ${old[`minus_${axis}`]}`))
      made.description = made.description.endsWith(kTurned[axis])
        ? made.description.slice(0, -kTurned[axis].length)
        : made.description + kTurned[axis];
  }
  return made;
}

/** 'left' or 'right', if the body's description or name begins with it. */
export const sideOf = ({ description, name }) =>
  [description, name].map((text) => /^(left|right)\b/i.exec(text ?? '')?.[1].toLowerCase()).find(Boolean);

const ofObjects = (list) => Array.isArray(list) && list.every(isObject);
/** Whether the document, which may be being typed, has lists of groups, structures and rules. */
export const isWhole = ({ volume }) =>
  [volume?.groups, volume?.structures, volume?.rules].every(ofObjects) &&
  volume.groups.every(({ parts }) => ofObjects(parts));

const onSkin = (volume) => volume.rules.filter(({ group, from_m }) => group === volume.skin && from_m < 0);
function fatRule(volume) {
  const fats = volume.structures.filter((s) => kindOf(s).name === 'FAT').map(({ id }) => id);
  return onSkin(volume).find(({ structure, clips }) => fats.includes(structure) && !clips);
}

/** A whole body's subcutaneous fat, its thickness; undefined: no rule puts fat under its skin. */
export function fatOf({ volume }) {
  const rule = fatRule(volume);
  if (!rule) return undefined;
  const above = onSkin(volume)
    .map((r) => r.from_m)
    .filter((m) => m > rule.from_m);
  return rounded((above.length > 0 ? Math.min(...above) : 0) - rule.from_m);
}

/**
 * More subcutaneous fat, or less: the skin moves out by `by_m`, what lies under the fat keeps its form, and the whole
 * body moves in, so that the needle still enters at the origin. An ellipsoid's surface moves by `by_m` along its axes.
 * @param {any} profile
 * @param {number} by_m
 * @param {{x: number, y: number, z: number}} up the skin's normal at the origin
 */
export function fatter(profile, by_m, up) {
  const { volume } = profile,
    { from_m } = fatRule(volume);
  const grow = { length: (r) => Math.max(r + by_m, kLeast * r) };
  const grown = ({ blend_m, half_space: plane, ...shape }) => ({
    ...mapped(shape, grow),
    ...(plane && {
      half_space: mapped(plane, { point: (v, axis) => v + (by_m * plane.normal[axis]) / length(plane.normal) }),
    }),
    ...(blend_m !== undefined && { blend_m }),
  });
  const deeper = (range) =>
    range.group === volume.skin ? mapped(range, { length: (m) => (m <= from_m ? m - by_m : m) }) : range;
  const groups = volume.groups.map((group) =>
    group.id === volume.skin ? { ...group, parts: group.parts.map(grown) } : group,
  );
  const rules = volume.rules.map(({ clips, ...rule }) => ({
    ...deeper(rule),
    ...(clips && { clips: clips.map(deeper) }),
  }));
  return shifted(
    { ...profile, volume: { ...volume, groups, rules } },
    each(up, (v) => -by_m * v),
  );
}
const length = (v) => Math.hypot(v.x, v.y, v.z);

/** What bodies of one family have in common: groups, shapes and rules without their numbers. */
export const outline = ({ volume }) =>
  JSON.stringify(volume ?? null, (key, value) => (key === 'layer' ? undefined : typeof value === 'number' ? 0 : value));

/** `a + share · (b − a)` of all numbers. */
function mixed(a, b, share) {
  if (typeof a === 'number') return a + share * (b - a);
  if (Array.isArray(a)) return a.map((item, i) => mixed(item, b[i], share));
  if (!isObject(a)) return a;
  return Object.fromEntries(Object.entries(a).map(([key, item]) => [key, mixed(item, b[key] ?? item, share)]));
}
const geometry = ({ volume, targets }) => ({ volume, targets });
/** The family's body at −1, slender, 0, median, 1, heavy, and between them. @param {any[]} family */
const bodyAt = ([slender, median, heavy], build) =>
  build < 0 ? mixed(geometry(slender), geometry(median), build + 1) : mixed(geometry(median), geometry(heavy), build);

/** `value` with what changes from `a` to `b`. */
function carried(value, a, b) {
  if (typeof value === 'number') return typeof a === 'number' && a !== b ? rounded(value + b - a) : value;
  if (Array.isArray(value)) return value.map((item, i) => carried(item, a?.[i], b?.[i]));
  if (!isObject(value)) return value;
  return Object.fromEntries(Object.entries(value).map(([key, item]) => [key, carried(item, a?.[key], b?.[key])]));
}

/**
 * Another build of the family, by interpolating all lengths, forces and the targets; what the author changed stays
 * changed. The needle follows if it is that of the nearest build.
 * @param {any} profile
 * @param {any[]} family slender, median, heavy, as `fitOf` takes them
 * @param {{build: number, size: number, mirrored: string}} from what the profile is; `mirrored`: across that axis, or ''
 * @param {number} build
 */
export function built(profile, family, from, build) {
  const placed = (body) => {
    const sized = scaled(body, from.size);
    return from.mirrored ? mirrored(sized, from.mirrored) : sized;
  };
  const [a, b] = [placed(bodyAt(family, from.build)), placed(bodyAt(family, build))];
  const needle = (t) => family[Math.round(t) + 1].needle;
  const follows = JSON.stringify(profile.needle) === JSON.stringify(needle(from.build));
  return {
    ...profile,
    volume: carried(profile.volume, a.volume, b.volume),
    targets: profile.targets?.map((target, i) =>
      target.structure && target.structure === a.targets?.[i]?.structure
        ? carried(target, a.targets[i], b.targets[i])
        : target,
    ),
    ...(follows && { needle: needle(build) }),
  };
}

/** All lengths of a body under its skin and fat, its points from their middle. @returns {number[]} */
function lengthsOf({ volume }, flipped) {
  const points = { x: [], y: [], z: [] },
    lengths = [];
  const inner = {
    groups: volume.groups.filter(({ id }) => id !== volume.skin),
    rules: volume.rules.filter(({ group }) => group !== volume.skin),
  };
  mapped(inner, { point: (v, axis) => points[axis].push(v), length: (v) => lengths.push(v) });
  const middle = (list) => list.reduce((sum, v) => sum + v, 0) / list.length;
  return [
    ...kAxes.flatMap((axis) => points[axis].map((v) => (axis === flipped ? -1 : 1) * (v - middle(points[axis])))),
    ...lengths,
  ];
}
const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);

/**
 * Which body of the family this one is, by least squares.
 * @param {any} profile of the family's outline
 * @param {any[]} family
 * @returns {{build: number, size: number, mirrored: string}|null} null: it is none of them
 */
export function fitOf(profile, family) {
  const known = family.map((body) => lengthsOf(body));
  let best = null;
  for (const flipped of ['', 'x', 'y']) {
    const own = lengthsOf(profile, flipped);
    for (const k of [0, 1]) {
      const [a, b] = [known[k], known[k + 1]];
      const [aa, ab, bb, av, bv] = [dot(a, a), dot(a, b), dot(b, b), dot(a, own), dot(b, own)];
      const [p, q] = [av * bb - bv * ab, bv * aa - av * ab];
      const share = Math.min(1, Math.max(0, q / (p + q))),
        body = a.map((v, i) => v + share * (b[i] - v)),
        size = dot(body, own) / dot(body, body);
      const off = Math.hypot(...own.map((v, i) => v - size * body[i])) / Math.hypot(...own);
      if (!best || off < best.off) best = { off, build: k - 1 + share, size, mirrored: flipped };
    }
  }
  if (!(best.off < kFits && best.size > 0)) return null;
  return {
    build: Math.round(best.build * 1000) / 1000,
    size: Math.round(best.size * 1000) / 1000,
    mirrored: best.mirrored,
  };
}

/**
 * @param {{doc: any, at: {build: number, size: number, mirrored: string}, up: any}} mark a body, what it is, and the skin's normal
 * @param {{build: number, size: number, mirrored: string, fat_m: number}} to `fat_m`: more than the body then has
 * @param {any[]|null} family
 */
export function reshaped({ doc, at, up }, to, family) {
  let made = to.build === at.build || !family ? doc : built(doc, family, at, to.build);
  if (to.size !== at.size) made = scaled(made, to.size / at.size);
  const turned = to.mirrored !== at.mirrored,
    axis = to.mirrored || at.mirrored;
  if (turned) made = mirrored(made, axis);
  return to.fat_m ? fatter(made, to.fat_m, turned ? { ...up, [axis]: -up[axis] } : up) : made;
}

// A body: its structures, the targets and hazards that are structures, and its cut as the server sends it
// (ProfileSection). Pure; metres.
import { hazardKindOf, layerNames, structureColors } from './tissue.js';
import { quantity, words } from './units.js';

/** The ids and usual names of a profile's structures. @returns {[string, string][]} */
export function structuresOf(profile) {
  const names = layerNames(profile);
  return profile?.volume ? names.map((name, i) => [profile.volume.structures[i]?.id ?? '', name]) : [];
}

/** The name of the structure that a target or hazard is; an id that no structure has, as it is; '' for a shape. */
export const structureName = (profile, { structure }) =>
  structure ? (structuresOf(profile).find(([id]) => id === structure)?.[1] ?? structure) : '';

/** "dural sac (Nerve; dura and arachnoid)": a target or hazard with its kind, and its structure if that differs. */
export function regionWords(profile, region) {
  const structure = structureName(profile, region),
    kind = profile?.hazards?.includes(region) ? hazardKindOf(profile, region) : region.kind,
    more = [kind && words(kind), structure !== region.name && structure].filter(Boolean);
  return `${region.name}${more.length > 0 ? ` (${more.join('; ')})` : ''}`;
}

/**
 * What a structure is marked as. A structure that is both is a hazard.
 * @param {any} profile
 * @param {number} index of the structure
 * @returns {{kind: 'target'|'hazard', name: string}|undefined}
 */
export function markOf({ targets = [], hazards = [], volume }, index) {
  const id = volume?.structures?.[index]?.id;
  const named = (regions) => regions.find(({ structure }) => structure && structure === id);
  const hazard = named(hazards),
    found = hazard ?? named(targets);
  return found && { kind: hazard ? 'hazard' : 'target', name: found.name ?? '' };
}

/** The target as a structure, which it still has a point of; '': as a ball. What the other kind has, it loses. */
export function targetAs(structure, target) {
  const { radius_m, tissues, anchor, structure: before, ...rest } = target;
  if (structure) return { ...rest, structure };
  return { ...rest, center_m: rest.center_m ?? { x: 0, y: 0, z: -0.02 }, radius_m: radius_m ?? 0.003 };
}

/** @returns {'ball'|'line'|'structure'} */
export const hazardForm = ({ structure, a_m }) => (structure !== undefined ? 'structure' : a_m ? 'line' : 'ball');

/**
 * The hazard in another form, in its place if it has one.
 * @param {'ball'|'line'|'structure'} form
 * @param {any} hazard
 * @param {string} [structure]
 */
export function hazardAs(form, hazard, structure = '') {
  const { center_m, a_m, b_m, radius_m, anchor, structure: before, ...rest } = hazard;
  if (form === 'structure') return { ...rest, structure };
  const at = center_m ?? a_m ?? { x: 0, y: 0, z: 0 },
    shape = { ...rest, ...(anchor && { anchor }), radius_m: radius_m ?? 0.002 };
  return form === 'ball'
    ? { ...shape, center_m: at }
    : { ...shape, a_m: at, b_m: { ...at, x: (Number(at.x) || 0) + 0.02 } };
}

/** The runs of a cut: from where on in a row, y down, and of which structure; −1: outside. */
function* runsOf({ runs, rows, columns }) {
  let x = 0,
    y = rows - 1;
  for (let i = 0; i + 1 < runs.length; i += 2) {
    yield { index: runs[i] - 1, x, y, length: runs[i + 1] };
    x += runs[i + 1];
    if (x < columns) continue;
    x = 0;
    y -= 1;
  }
}

/**
 * For each structure in the cut: its area as the path of an SVG in points of the grid, y down, and a place for its
 * name: the middle of its longest run.
 * @param {any} section
 * @returns {{index: number, name: string, color: string, path: string, at: {x: number, y: number}, points: number}[]} the largest first
 */
export function areasOf(section) {
  const areas = new Map(),
    colors = structureColors(section.structures);
  for (const { index, x, y, length } of runsOf(section)) {
    if (index < 0) continue;
    const area = areas.get(index) ?? { path: [], points: 0, longest: 0, at: { x: 0, y: 0 } };
    area.path.push(`M${x} ${y}h${length}v1h-${length}z`);
    area.points += length;
    if (length > area.longest) {
      area.longest = length;
      area.at = { x: x + length / 2, y: y + 0.5 };
    }
    areas.set(index, area);
  }
  return [...areas]
    .map(([index, { path, points, at }]) => {
      return { index, name: section.structures[index].name, color: colors[index], path: path.join(''), at, points };
    })
    .sort((a, b) => b.points - a.points);
}

/**
 * The skin at a column of the cut, the middle: the place of insertion.
 * @returns {{u: number, w: number}|undefined} from the upper left corner to the right and down; undefined: no skin there
 */
export function entryIn(section, middle = section.columns / 2) {
  let top = section.rows;
  for (const { index, x, y, length } of runsOf(section))
    if (index >= 0 && x <= middle && middle < x + length) top = Math.min(top, y);
  return top < section.rows ? { u: middle * section.point_m, w: top * section.point_m } : undefined;
}

/**
 * A point of the profile's frame in the cut.
 * @returns {{u: number, w: number, v: number}} from the upper left corner to the right and down, and behind the cut
 */
export function inSection({ corner_m, across, upward, point_m, rows }, p) {
  const d = ['x', 'y', 'z'].map((axis, i) => (Number(p?.[axis]) || 0) - corner_m[i]);
  const along = (way) => way.reduce((sum, k, i) => sum + k * d[i], 0);
  const [a, b] = [across, upward];
  const out = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  return { u: along(a), w: rows * point_m - along(b), v: -along(out) };
}

/** The point of the profile's frame at a place of the cut: the inverse of `inSection`. */
export function fromSection({ corner_m, across, upward, point_m, rows }, { u, w, v = 0 }) {
  const [a, b] = [across, upward];
  const out = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const at = (i) => corner_m[i] + a[i] * u + b[i] * (rows * point_m - w) - out[i] * v;
  return { x: at(0), y: at(1), z: at(2) };
}

const kBeside_m = 0.002; // a tip farther from the cut than this is beside it

/** "Tip 4 mm behind the cut". @param {number} v of `inSection` */
export const besideCut = (v) =>
  Math.abs(v) > kBeside_m
    ? `Tip ${quantity(Math.abs(v), 'm', { digits: 2 })} ${v > 0 ? 'behind' : 'in front of'} the cut`
    : 'Tip in the cut, or at most 2\u00a0mm beside it';

// The kinds, colours and names of layers in the whole console. A name is always shown beside a colour.
import { kKinds, kMuscleColors } from '../profile/kinds.js';

export const kTissues = ['SKIN', 'FAT', 'MUSCLE', 'BURSA', 'CAPSULE', 'TENDON', 'CARTILAGE', 'BONE', 'OTHER'];

const kColors = {
  SKIN: '#e8b99b',
  FAT: '#f4e09a',
  MUSCLE: '#dc9489',
  BURSA: '#a5d3e6',
  CAPSULE: '#cbb2dc',
  TENDON: '#c9d6a8',
  CARTILAGE: '#aedbca',
  BONE: '#e6e0cf',
  OTHER: '#cfd3d6',
};

export const tissueColor = (tissue) => kColors[tissue] ?? kColors.OTHER;

const kindNamed = (name) => kKinds.find((row) => row.name === name);

/**
 * What a structure is, of a profile or as the server sends it, as in common/profile/structure_kinds.h: its kind; without
 * one its tissue's.
 * @returns {typeof kKinds[number]}
 */
export const kindOf = (structure) =>
  kindNamed(structure?.kind) ?? kindNamed(structure?.layer?.tissue ?? structure?.tissue) ?? kKinds.at(-1);

/** A structure's tissue; without one its kind's. */
export const tissueOf = (structure) => structure?.layer?.tissue ?? kindOf(structure).tissue;

/** A hazard's kind; without one that of its structure. */
export const hazardKindOf = (profile, { kind, structure }) =>
  kind ?? (structure && kindOf(list(profile?.volume?.structures).find((s) => s?.id === structure)).hazard);

/** The colours of a body's structures, those of the windows. @returns {string[]} */
export function structureColors(structures) {
  let muscles = 0;
  return structures.map((structure) => {
    const { name, color } = kindOf(structure);
    return name === 'MUSCLE' ? kMuscleColors[muscles++ % kMuscleColors.length] : color;
  });
}

const list = (value) => (Array.isArray(value) ? value : []);
const text = (value) => (typeof value === 'string' ? value : '');

/**
 * What the column `layer` of a recording counts, as in common/profile/layer_names.h: the layers from the skin inwards;
 * of a body, what each structure is.
 * @returns {any[]} an item that is being typed may have any type
 */
export const profileLayers = (profile) =>
  profile?.volume ? list(profile.volume.structures).map((s) => s?.layer) : list(profile?.layers);

/** The colours of what `layerNames` names. @returns {string[]} */
export const layerColors = (profile) =>
  profile?.volume
    ? structureColors(list(profile.volume.structures))
    : profileLayers(profile).map((layer) => tissueColor(layer?.tissue));

/**
 * The usual names of `profileLayers`, as in common/profile/layer_names.h (the cases of both:
 * tests/data/profile/layer_names.json). While a profile is being typed, a tissue may be missing, or a value of any
 * type. A structure without a name has its id.
 * @param {{layers?: {tissue?: string, name?: string}[], volume?: {structures?: {id?: string, layer?: {name?: string}}[]}}|null|undefined} profile
 * @returns {string[]}
 */
export function layerNames(profile) {
  const layers = profileLayers(profile).map((l) => ({ name: text(l?.name), tissue: text(l?.tissue) })),
    seen = new Map();
  if (profile?.volume) return layers.map(({ name }, i) => name || text(profile.volume.structures[i]?.id));
  return layers.map(({ name, tissue }, i) => {
    if (name) return name;
    if (!tissue || tissue === 'OTHER') return `layer ${i + 1}`;
    const word = tissue.toLowerCase();
    if (layers.filter((l) => !l.name && l.tissue === tissue).length === 1) return word;
    seen.set(tissue, (seen.get(tissue) ?? 0) + 1);
    return `${word} ${seen.get(tissue)}`;
  });
}

/**
 * `after`, in which targets and hazards mention the layers by their present names: a layer in the same place whose old
 * name no layer has any more was renamed.
 */
export function followLayerNames(before, after) {
  const old = layerNames(before),
    now = layerNames(after);
  if (old.length !== now.length) return after;
  const renamed = new Map(old.map((name, i) => [name, now[i]]).filter(([name]) => !now.includes(name)));
  if (renamed.size === 0) return after;
  const called = (name) => renamed.get(name) ?? name;
  const follow = (region) => ({
    ...region,
    ...(Array.isArray(region?.tissues) && { tissues: region.tissues.map(called) }),
    ...(region?.anchor && { anchor: { ...region.anchor, layer: called(region.anchor.layer) } }),
  });
  const all = (list) => (Array.isArray(list) ? list.map(follow) : list);
  return {
    ...after,
    ...(after.targets && { targets: all(after.targets) }),
    ...(after.hazards && { hazards: all(after.hazards) }),
  };
}

/** Curves, which also differ by their dashes. */
export const kCurves = [
  { color: '#0b4f6c', dash: [] },
  { color: '#b3430b', dash: [8, 4] },
  { color: '#14602f', dash: [2, 3] },
  { color: '#6a2c91', dash: [10, 3, 2, 3] },
  { color: '#7a4b00', dash: [4, 4] },
  { color: '#444', dash: [1, 4] },
];

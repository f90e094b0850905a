// The colours and names of layers in the whole console. A name is always shown beside a colour.

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

/**
 * The usual names of the layers, from the skin inwards, as in common/profile/layer_names.h (the cases of both:
 * tests/data/profile/layer_names.json). While a profile is being typed, a tissue may be missing, or a value of any
 * type. Of a volume, its structures: their names, or ids.
 * @param {{layers?: {tissue?: string, name?: string}[], volume?: {structures?: {id?: string, layer?: {name?: string}}[]}}|null|undefined} profile
 * @returns {string[]}
 */
export function layerNames(profile) {
  const text = (value) => (typeof value === 'string' ? value : '');
  const structures = profile?.volume?.structures;
  if (Array.isArray(structures)) return structures.map((s) => text(s?.layer?.name) || text(s?.id));
  const layers = (Array.isArray(profile?.layers) ? profile.layers : []).map((l) => ({
      name: text(l?.name),
      tissue: text(l?.tissue),
    })),
    seen = new Map();
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

// The colours of tissues in the whole console. Their names are always shown beside the colours.

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

/** Curves: told apart by their dashes as well. */
export const kCurves = [
  { color: '#0b4f6c', dash: [] },
  { color: '#b3430b', dash: [8, 4] },
  { color: '#14602f', dash: [2, 3] },
  { color: '#6a2c91', dash: [10, 3, 2, 3] },
  { color: '#7a4b00', dash: [4, 4] },
  { color: '#444', dash: [1, 4] },
];

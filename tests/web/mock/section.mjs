// A body for the mock server: level bands, each of one structure of a profile with a volume.

const kBands_mm = [2, 8, 1, 6, 6, 22, 4, 5, 1, 40];
const kPoint_m = 0.25e-3,
  kColumns = 416,
  kRows = 320,
  kAbove_m = 0.012;

/** The profile as layers, one for each band, as `gesture` moves through them. */
export const bandsOf = (profile) => ({
  ...profile,
  layers: kBands_mm.map((mm, i) => ({ ...profile.volume.structures[i].layer, thickness_m: mm / 1000 })),
});

/** The cut of the bands by y = 0, where the mock's needle comes in at the origin. */
export function sectionOf(profile) {
  const bottoms_m = kBands_mm.map((_, i) => kBands_mm.slice(0, i + 1).reduce((a, b) => a + b) / 1000);
  const height_m = kRows * kPoint_m;
  return {
    corner_m: [-0.5 * kColumns * kPoint_m, 0, kAbove_m - height_m],
    across: [1, 0, 0],
    upward: [0, 0, 1],
    point_m: kPoint_m,
    columns: kColumns,
    rows: kRows,
    structures: profile.volume.structures.map(({ id, kind, layer }) => ({
      name: layer.name ?? id,
      tissue: layer.tissue,
      kind,
    })),
    runs: Array.from({ length: kRows }, (_, row) => {
      const depth_m = height_m - kAbove_m - (row + 0.5) * kPoint_m;
      return [depth_m < 0 ? 0 : 1 + bottoms_m.findIndex((bottom_m) => depth_m < bottom_m), kColumns];
    }).flat(),
  };
}

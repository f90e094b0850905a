// A body's cut as the server sends it (ProfileSection), as paths and names. Pure; points of the grid, y down.
import { tissueColor } from './tissue.js';

const kWords = [
  [/nerve|plexus/, '#f2dc3c'],
  [/arter|vessel/, '#d0392b'],
  [/vein/, '#5a79cf'],
  [/fluid/, '#a9d3ea'],
];

/** By tissue; nerves, vessels and fluids, which no tissue stands for, by a word of their name. */
export const structureColor = ({ tissue, name }) =>
  (tissue === 'OTHER' && kWords.find(([word]) => word.test(name))?.[1]) || tissueColor(tissue);

/**
 * For each structure in the cut: its area as the path of an SVG, and a place for its name: the middle of its longest
 * run.
 * @param {any} section a ProfileSection
 * @returns {{index: number, name: string, color: string, path: string, at: {x: number, y: number}, points: number}[]} the largest first
 */
export function areasOf(section) {
  const areas = new Map();
  let x = 0,
    row = 0;
  for (let i = 0; i + 1 < section.runs.length; i += 2) {
    const [index, length] = [section.runs[i], section.runs[i + 1]],
      y = section.rows - 1 - row;
    if (index > 0) {
      const area = areas.get(index) ?? { path: [], points: 0, longest: 0, at: { x: 0, y: 0 } };
      area.path.push(`M${x} ${y}h${length}v1h-${length}z`);
      area.points += length;
      if (length > area.longest) {
        area.longest = length;
        area.at = { x: x + length / 2, y: y + 0.5 };
      }
      areas.set(index, area);
    }
    x += length;
    if (x >= section.columns) {
      x = 0;
      row += 1;
    }
  }
  return [...areas]
    .map(([index, { path, points, at }]) => {
      const structure = section.structures[index - 1];
      return {
        index: index - 1,
        name: structure.name,
        color: structureColor(structure),
        path: path.join(''),
        at,
        points,
      };
    })
    .sort((a, b) => b.points - a.points);
}

/** Where a point of the profile's frame lies in the cut, and how far before it, in points of the grid. */
export function inSection(section, p) {
  const d = ['x', 'y', 'z'].map((axis, i) => (Number(p?.[axis]) || 0) - section.corner_m[i]);
  const along = (way) => way.reduce((sum, k, i) => sum + k * d[i], 0) / section.point_m;
  const [a, b] = [section.across, section.upward];
  const out = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  return { x: along(a), y: section.rows - along(b), off: along(out) };
}

// The y axis of a plot: its least span, so that noise does not look like a movement. Pure.
import { kMeasures } from './measure_rows.js';

/**
 * Least spans in shown units: large compared with the devices' noise (0.03 mm, 0.01 N), small compared with what a
 * teacher corrects. The windows' table, with the reasons, is in client/view/model/plot.cpp.
 */
export const kLeastSpans = {
  number: 1,
  force: 2, // N
  torque: 0.05, // N·m
  distance: 5, // mm from a line or a point
  depth: 10, // mm
  speed: 20, // mm/s
  angle: 10, // °
  time: 5, // s
  area: 0.5, // cm²
  work: 0.05, // J
  share: 100, // %
};
const kQuantities = {
  '': 'number',
  N: 'force',
  'N·m': 'torque',
  mm: 'distance',
  'mm/s': 'speed',
  '°': 'angle',
  s: 'time',
  'cm²': 'area',
  J: 'work',
  '%': 'share',
};
const kZeroIsNear = 0.6, // share of the largest value: zero nearer than this joins the axis
  kAir = 0.05; // margin beyond the data, not beyond zero

/** The quantity of a shown unit; undefined for a unit that has none. */
export const quantityOfUnit = (unit) => kQuantities[unit];

/** A limit that the exercise sets, as a line in the plot. @typedef {{at: number, label: string}} Limit */

/**
 * The range of the y axis. It contains data, limits, and zero if that is near, and spans at least the quantity's least
 * span: centred on the data, but not beyond zero if all data lie on one side.
 * @param {number|null|undefined} low of the data; null: an empty plot
 * @param {number|null|undefined} high
 * @param {string} [quantity] a name of kLeastSpans
 * @param {Limit[]} [limits]
 * @returns {[number, number]}
 */
export function axisRange(low, high, quantity, limits = []) {
  const empty = !Number.isFinite(low) || !Number.isFinite(high);
  const ends = [...(empty ? [0] : [low, high]), ...limits.map((l) => l.at).filter(Number.isFinite)];
  let from = Math.min(...ends),
    to = Math.max(...ends);
  if (from > 0 && from < kZeroIsNear * to) from = 0;
  if (to < 0 && to > kZeroIsNear * from) to = 0;
  const above = from >= 0,
    below = to <= 0;
  const air = kAir * (to - from);
  if (from !== 0) from -= air;
  if (to !== 0) to += air;
  const missing = (kLeastSpans[quantity] ?? (to > from ? 0 : 1)) - (to - from);
  if (missing > 0) [from, to] = [from - missing / 2, to + missing / 2];
  if (above && from < 0) return [0, to - from];
  if (below && to > 0) return [from - to, 0];
  return [from, to];
}

/** Measures that judge a quantity plotted from a recording, by quantity. */
const kJudging = { force: kMeasures.force, depth: kMeasures.depth };

/**
 * The exercise's limits in a plot of that quantity.
 * @param {string} quantity
 * @param {{measure: string, min?: number, max?: number}[]} rows of a score
 * @param {number} factor shown = SI · factor
 * @param {(value: number) => string} say returns the limit as text with its unit
 * @returns {Limit[]}
 */
export function limitsOf(quantity, rows, factor, say) {
  const row = rows?.find((r) => r.measure === kJudging[quantity]);
  return [
    ['min', 'at least'],
    ['max', 'at most'],
  ]
    .filter(([key]) => Number.isFinite(row?.[key]))
    .map(([key, word]) => ({ at: row[key] * factor, label: `${word} ${say(row[key])}` }));
}

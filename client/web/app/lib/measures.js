// Names of a score's measures. The server lists the kinds; a kind that each layer has is one row with a K instead of
// the layer's number (common/scoring/measures/measure_table.h). Pure.

import { kMeasures } from './measure_rows.js';
import { measureTitle, measureUnit, quantity } from './units.js';

/** @typedef {{name: string, unit: string, words: string}} Kind */

const isYesOrNo = (measure) => kMeasures.yes_or_no.includes(measure);
const isShare = (measure) => kMeasures.shares.includes(measure);

/**
 * A measure's value or limit as text: "3.2 N", "8 %", "yes". tests/data/scoring/measure_texts.json has examples, also
 * for measureText of common/scoring.
 * @param {string} measure
 * @param {number|null|undefined} value
 * @param {string} unit the row's
 * @param {{digits?: number, locale?: string}} [options]
 */
export function measureText(measure, value, unit, options) {
  if (isYesOrNo(measure) && Number.isFinite(value)) return value > 0 ? 'yes' : 'no';
  return quantity(value, isShare(measure) ? 'share' : unit, options);
}

/** Likewise for a mean or a spread: yes-or-no in percent, because half a yes is not a value. */
export const meanText = (measure, value, unit, options) =>
  isYesOrNo(measure) ? quantity(value, 'share', options) : measureText(measure, value, unit, options);

/** Whether the row says 0 N of a tissue that the tip never was in, and nothing is required there (measure_table.h). */
export const isOfTissueNotMet = (row) =>
  /^peak_force_layer_\d+_n$/.test(row.measure) && row.value === 0 && typeof row.passed !== 'boolean';

/**
 * The requirement on a measure: "at most 5 N", "20 mm to 30 mm", "yes"; '' without one.
 * @param {{measure: string, unit: string, min?: number, max?: number}} row
 */
export function requirementText({ measure, unit, min, max }, options) {
  const text = (value) => measureText(measure, value, unit, options);
  if (min === undefined && max === undefined) return '';
  if (isYesOrNo(measure)) return (min ?? 0) > 0 ? 'yes' : 'no';
  if (min !== undefined && max !== undefined) return `${text(min)} to ${text(max)}`;
  return min !== undefined ? `at least ${text(min)}` : `at most ${text(max)}`;
}

/**
 * The unit in which a plot or a field shows a measure: SI value = shown value · factor.
 * @param {string} measure
 * @param {string} unit the measure's
 */
export function shownUnit(measure, unit) {
  if (isShare(measure)) return { factor: 0.01, unit: '%' };
  return isYesOrNo(measure) ? { factor: 1, unit: '1: yes, 0: no' } : measureUnit(unit);
}

/**
 * The title of a score's row. Its words begin with the name, unless it could not be measured.
 * @param {{measure: string, value: number|null, words?: string}} row
 * @param {Kind[]} kinds
 * @param {string[]} [layers]
 */
export function rowTitle(row, kinds, layers = []) {
  if (row.value !== null && row.value !== undefined) return measureTitle(row);
  return measureNamed(kinds, row.measure, layers)?.words ?? 'unknown measure';
}

/**
 * What a required row's value, limit and verdict do not say: why it was not measured, or that rounding hides the
 * difference; '' if they say all.
 * @param {{value: number|null, words?: string, passed?: boolean}} row
 */
export function rowRemark({ value, words = '', passed }) {
  if (typeof passed !== 'boolean') return '';
  return value === null ? words : (/: (just (?:above|below)) the /.exec(words)?.[1] ?? '');
}

/**
 * A comparison's words without the name and value that stand beside them: "above the experts' range, 2 N to 3 N".
 * @param {{words: string, n?: number}} beside
 * @param {number} experts as said elsewhere on the page: not repeated
 */
export function placeWords({ words, n }, experts) {
  const place = /: ([^:]*)$/.exec(words)?.[1] ?? words;
  return n === experts ? place.replace(/ \(\d+ gestures?\)$/, '') : place;
}

/**
 * Positions of the experts' range and of the value in a picture, from 0 to 1, like placeMarks of common/scoring.
 * @param {{least: number, greatest: number, value: number}} beside a row of the comparison that has a place
 */
export function placeMarks({ least, greatest, value }) {
  const low = Math.min(least, value),
    high = Math.max(greatest, value);
  const at = (v) => 0.1 + (0.8 * (v - low)) / (high - low);
  return { least: at(least), greatest: at(greatest), value: at(value) };
}

/**
 * A measure by its name, "Peak force in dura"; with the layer's number if the patient has no such layer.
 * @param {Kind[]} kinds
 * @param {string} name "peak_force_layer_3_n"
 * @param {string[]} layers `layerNames` of the patient
 * @returns {Kind|undefined} undefined: no score has it
 */
export function measureNamed(kinds, name, layers) {
  for (const kind of kinds) {
    const [before, after] = kind.name.split('K');
    if (after === undefined && kind.name === name) return kind;
    if (after === undefined || !name?.startsWith(before) || !name.endsWith(after)) continue;
    const number = name.slice(before.length, name.length - after.length);
    if (!/^[1-9]\d*$/.test(number)) continue;
    const layer = layers[Number(number) - 1];
    const words = layer === undefined ? kind.words.replace('K', number) : kind.words.replace('layer K', () => layer);
    return { ...kind, name, words };
  }
  return undefined;
}

/**
 * All measures of one patient's scores; kinds that each layer has, once per layer.
 * @param {Kind[]} kinds
 * @param {string[]} layers
 * @returns {Kind[]}
 */
export function measuresOf(kinds, layers) {
  return kinds.flatMap((kind) =>
    kind.name.includes('K')
      ? layers.map((_, i) => measureNamed([kind], kind.name.replace('K', i + 1), layers))
      : [kind],
  );
}

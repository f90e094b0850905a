// The verdict on an attempt in words for people. The codes are the server's: `passed` of a session or a score, and the
// values of the query `verdict`.
import { kEffects } from '../profile/effects.js';
import { atStart } from './units.js';

/** Code of the query, and its words. */
export const kVerdicts = [
  ['passed', 'passed'],
  ['failed', 'not passed'],
  ['none', 'no verdict'],
];

/**
 * The kind of mark, and its words.
 * @param {boolean|undefined|null} passed absent: no score, or nothing is required
 * @returns {['good'|'bad'|'open', string]}
 */
export function verdictOf(passed) {
  const word = new Map(kVerdicts);
  if (passed === true) return ['good', word.get('passed')];
  if (passed === false) return ['bad', word.get('failed')];
  return ['open', word.get('none')];
}

/** With this share of chance or less a trend counts (common/scoring/attempts/progress.cpp). */
const kClear_p = 0.05;

/**
 * How a measure went over the attempts: the kind of mark, and its words.
 * @param {{better: 'less'|'more'|'neither', trend: {tau: number, p: number}|null}|undefined} row of the server's progress
 * @returns {['good'|'bad'|'open'|'info', string]}
 */
export function trendOf(row) {
  if (!row?.trend) return ['open', 'too few attempts yet'];
  const { tau, p } = row.trend;
  if (!(p <= kClear_p)) return ['info', 'as before'];
  if (row.better === 'neither') return ['info', tau > 0 ? 'rises' : 'falls'];
  return (row.better === 'more') === tau > 0 ? ['good', 'better'] : ['bad', 'worse'];
}

/**
 * Same for all that an exercise requires: better if more of its measures became better than worse.
 * @param {any[]} rows of the server's progress
 * @param {string[]} required names of measures
 */
export function trendOfAll(rows, required) {
  const words = rows.filter((row) => row.trend && required.includes(row.measure)).map((row) => trendOf(row)[1]);
  if (words.length === 0) return trendOf(undefined);
  const count = (word) => words.filter((w) => w === word).length;
  const lead = count('better') - count('worse');
  return lead > 0 ? ['good', 'better'] : lead < 0 ? ['bad', 'worse'] : ['info', 'as before'];
}

/**
 * As stiffnessShareText of common/haptics: beside the score of a session that was not rendered as in its profile.
 * @param {{stiffness_share?: any, delay_stiffness_share?: any, device_notes?: string[]}} description
 */
export function stiffnessShareText({ stiffness_share: share, delay_stiffness_share: delay, device_notes }) {
  // what is across the needle before what turns it
  const lowered = kEffects
    .filter((effect) => effect.lowered)
    .sort((a, b) => Number(a.lowered.turns) - Number(b.lowered.turns));
  const is_left_out = ({ name, lowered: { without } }) =>
    without && (device_notes ?? []).some((note) => note.includes(`${name} is not live`));
  const sentences = lowered
    .filter(is_left_out)
    .map(({ lowered: { words, without } }) => `${atStart(words)} was left out: ${without}.`);
  const words = lowered.filter((effect) => !is_left_out(effect)).map((effect) => effect.lowered.words);
  if (share > 0 && share < 1)
    sentences.push(
      `${atStart(`${words.slice(0, -1).join(', ')} and ${words.at(-1)}`)} were rendered at ${(100 * share).toFixed(0)} % of the profile's stiffness.`,
    );
  if (sentences.length > 0) sentences.push('This device and tool cannot hold more.');
  if (delay > 0 && delay < 1)
    sentences.push(
      `Because the device's force comes late, what acts along the needle was rendered at ${(100 * delay).toFixed(0)} % of the profile's stiffness: the tissue's forces are the same, over a longer way.`,
    );
  return sentences.join(' ');
}

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

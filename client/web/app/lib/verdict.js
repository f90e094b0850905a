// The verdict on an attempt in words for people. The codes are the server's: `passed` of a session or a score, and the
// values of the query `verdict`.

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
 * @param {{stiffness_share?: any, device_notes?: string[]}} description
 */
export function stiffnessShareText({ stiffness_share: share, device_notes }) {
  const without_bone = (device_notes ?? []).some((note) => note.includes('BONE is not live'));
  const sentences = [];
  if (without_bone) sentences.push('Bone was left out: the needle cut it as it cuts a layer of tissue.');
  if (share > 0 && share < 1)
    sentences.push(
      `${without_bone ? 'Fixture and orientation limit' : 'Fixture, bone and orientation limit'} were rendered at ${(100 * share).toFixed(0)} % of the profile's stiffness.`,
    );
  return sentences.length === 0 ? '' : [...sentences, 'This device and tool cannot hold more.'].join(' ');
}

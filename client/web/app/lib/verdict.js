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
 * @param {boolean|undefined|null} passed absent: there is no score, or nothing is required
 * @returns {['good'|'bad'|'open', string]}
 */
export function verdictOf(passed) {
  const word = new Map(kVerdicts);
  if (passed === true) return ['good', word.get('passed')];
  if (passed === false) return ['bad', word.get('failed')];
  return ['open', word.get('none')];
}

/** As stiffnessShareText of common/haptics: beside the score of a session that was rendered softer than its profile. */
export const stiffnessShareText = (share) =>
  share > 0 && share < 1
    ? `Fixture, bone and orientation limit were rendered at ${(100 * share).toFixed(0)} % of the profile's stiffness: device and tool hold no more.`
    : '';

// What a tile of the live page shows about its station. Pure.

/** Whether a lesson is running, with or without a name that the server knows. */
export const isPractising = (tile) => !!tile.online && !!(tile.session_id || tile.trainee);

/**
 * The kind of mark, and its word.
 * @param {{online: boolean, fault?: string, session_id?: string, trainee?: string}} tile
 * @returns {['bad'|'open'|'good'|'info', string]}
 */
export function tileState(tile) {
  if (tile.fault) return ['bad', 'fault'];
  if (!tile.online) return ['open', 'offline'];
  return isPractising(tile) ? ['good', 'practising'] : ['info', 'idle'];
}

/** @returns {'trouble'|'practising'|'idle'|'offline'} what a station's number on Home counts it as */
export function stationState(tile) {
  if (tile.fault) return 'trouble';
  if (!tile.online) return 'offline';
  return isPractising(tile) ? 'practising' : 'idle';
}

/** The trainee's name, which the server knows once it has the session. */
export const traineeWords = (tile) => traineeName(tile) || 'Name not known yet';

/** @param {{trainee?: string, trainee_full_name?: string}} of a session's description, an attempt, a tile, … */
export const traineeName = (of) => of.trainee_full_name || of.trainee;

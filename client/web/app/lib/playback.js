// Where a replay stands: seconds of the recording, pure, driven by the clock that it is given.

/** @typedef {{at_s: number, playing: boolean, speed: number, from_s: number, to_s: number}} Playback */

export const kSpeeds = [0.1, 0.25, 0.5, 1, 2, 4];

/** @returns {Playback} */
export const atRest = (from_s, to_s) => ({ at_s: from_s, playing: false, speed: 1, from_s, to_s });

const within = (p, at_s) => Math.max(p.from_s, Math.min(p.to_s, at_s));

/** @param {Playback} p */
export const seek = (p, at_s) => ({ ...p, at_s: within(p, at_s) });

/** Play at the end begins again. */
export const toggle = (p) => ({ ...p, playing: !p.playing, at_s: !p.playing && p.at_s >= p.to_s ? p.from_s : p.at_s });

/** `elapsed_s` of the wall clock later; stops at the end. */
export function advance(p, elapsed_s) {
  if (!p.playing) return p;
  const at_s = within(p, p.at_s + elapsed_s * p.speed);
  return { ...p, at_s, playing: at_s < p.to_s };
}

// How long to wait before the next try.

/**
 * Doubles from `first_ms` to `most_ms`; up to a quarter is taken off at random, so that a whole lab does not knock at once.
 * @param {number} attempt from 0
 * @param {{first_ms?: number, most_ms?: number, random?: () => number}} [options]
 */
export function backoff(attempt, { first_ms = 500, most_ms = 15_000, random = Math.random } = {}) {
  return Math.min(most_ms, first_ms * 2 ** Math.min(attempt, 20)) * (1 - random() / 4);
}

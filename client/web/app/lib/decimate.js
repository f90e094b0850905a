// Fewer points for a plot, without losing its peaks.

/**
 * Least and greatest value of each of `buckets` equal stretches of indices, in their order; keeps the first and last
 * point. A plot of the result looks like one of all points if a bucket is at most one pixel wide.
 * @param {ArrayLike<number>} x increasing
 * @param {ArrayLike<number|null>} y null and NaN: no value
 * @param {number} buckets at least 1
 * @returns {{x: number[], y: (number|null)[]}} at most 2·buckets + 2 points
 */
export function minMax(x, y, buckets) {
  const n = x.length;
  const whole = { x: Array.from(x), y: Array.from(y, (v) => (Number.isFinite(v) ? v : null)) };
  if (n <= 2 * buckets + 2) return whole;
  const keep = new Set([0, n - 1]);
  for (let b = 0; b < buckets; b++) {
    const begin = Math.floor((b * n) / buckets),
      end = Math.floor(((b + 1) * n) / buckets);
    let least = -1,
      most = -1;
    for (let i = begin; i < end; i++) {
      if (!Number.isFinite(y[i])) continue;
      if (least < 0 || y[i] < y[least]) least = i;
      if (most < 0 || y[i] > y[most]) most = i;
    }
    // keep a stretch without values visible as a gap
    if (least < 0) keep.add(begin);
    else keep.add(least).add(most);
  }
  const indices = [...keep].sort((a, b) => a - b);
  return { x: indices.map((i) => whole.x[i]), y: indices.map((i) => whole.y[i]) };
}

/**
 * The last index whose x is at most `at`; 0 before all.
 * @param {ArrayLike<number>} x increasing
 * @param {number} at
 */
export function indexAt(x, at) {
  let low = 0,
    high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle + 1;
    else high = middle;
  }
  return Math.max(0, low - 1);
}

// Gestures for the mock server: an approach, an insertion through the layers, a rest, a withdrawal. By seed, the same
// every time.

/** Mulberry32: small, good enough for a test double. */
export function random(seed) {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = a;
    t = Math.imul(t ^ (t >>> 15), t | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

const kRate_hz = 100;
const kBegin_s = 2,
  kRest_s = 3;

function smooth(x) {
  const c = Math.max(0, Math.min(1, x));
  return c * c * (3 - 2 * c);
}

/**
 * @param {object} profile with `palpation` the cap is on until the needle is near
 * @param {{seed: number, skill: number, depth_m: number}} hand skill 0 (novice) to 1 (expert)
 * @returns {Record<string, (number|null)[]>} columns as in the CSV of a session
 */
export function gesture(profile, { seed, skill, depth_m }) {
  const next = random(seed);
  const insert_s = 5 + 5 * (1 - skill) + next();
  const length_s = kBegin_s + insert_s + kRest_s + 2.5;
  const tremor_m = 0.0002 + 0.0012 * (1 - skill),
    tilt = 0.05 + 0.2 * (1 - skill) * next();
  const phase = next() * 6;
  const columns = Object.fromEntries(
    [
      't_s',
      'px_m',
      'py_m',
      'pz_m',
      'qx',
      'qy',
      'qz',
      'qw',
      'speed_m_s',
      'fx_n',
      'fy_n',
      'fz_n',
      'force_n',
      'phase',
      'layer',
      'insertion_m',
      'lateral_error_m',
      'plunger',
      'capped',
    ].map((n) => [n, []]),
  );
  let before = -0.02;
  for (let i = 0; i <= length_s * kRate_hz; i++) {
    const t = i / kRate_hz;
    const goal =
      t < kBegin_s
        ? -0.02 + 0.02 * smooth(t / kBegin_s)
        : t < kBegin_s + insert_s
          ? depth_m * smooth((t - kBegin_s) / insert_s)
          : t < kBegin_s + insert_s + kRest_s
            ? depth_m
            : depth_m - (depth_m + 0.02) * smooth((t - kBegin_s - insert_s - kRest_s) / 2.5);
    const shake = tremor_m * Math.sin(2 * Math.PI * 9 * t + phase) + 0.002 * (1 - skill) * Math.sin(1.9 * t + phase);
    const depth = goal + shake;
    const x = Math.tan(tilt) * depth + tremor_m * Math.sin(2 * Math.PI * 8 * t),
      y = 0.6 * tremor_m * Math.cos(2 * Math.PI * 7.3 * t + phase);
    let layer = -1,
      reached = 0,
      force = 0;
    if (depth > 0) {
      layer = profile.layers.findIndex((l) => (reached += l.thickness_m) > depth);
      if (layer < 0) layer = profile.layers.length - 1;
      const l = profile.layers[layer];
      const speed = (depth - before) * kRate_hz;
      force =
        speed > 0.001
          ? (l.cutting_force_n ?? 0)
          : speed < -0.001
            ? -(l.attracted_force_n ?? 0)
            : (l.rejection_force_n ?? 0);
      force += (l.friction_n_per_m ?? 0) * depth * 0.5 + 0.15 * (1 - skill) * Math.sin(11 * t);
    }
    const speed = (depth - before) * kRate_hz;
    before = depth;
    const row = {
      t_s: t,
      px_m: x,
      py_m: y,
      pz_m: -depth,
      qx: Math.cos(tilt / 2),
      qy: 0,
      qz: Math.sin(tilt / 2),
      qw: 0,
      speed_m_s: Math.abs(speed),
      fx_n: 0.05 * force,
      fy_n: 0,
      fz_n: force,
      force_n: Math.hypot(0.05 * force, force),
      phase: depth <= 0 ? 0 : Math.abs(speed) < 0.001 ? 2 : speed > 0 ? 1 : 3,
      layer,
      insertion_m: Math.max(0, depth),
      lateral_error_m: depth > 0 ? Math.abs(y) + tremor_m : 0,
      plunger:
        t < kBegin_s + insert_s + 0.5
          ? 0.5
          : t < kBegin_s + insert_s + 1
            ? 0.4
            : t < kBegin_s + insert_s + 2.5
              ? 0.4 + 0.5 * smooth((t - kBegin_s - insert_s - 1) / 1.5)
              : 0.9,
      capped: profile.palpation && t < 0.5 * kBegin_s ? 1 : 0,
    };
    for (const name of Object.keys(columns)) columns[name].push(row[name]);
  }
  return { columns, inserted_s: kBegin_s + insert_s, length_s };
}

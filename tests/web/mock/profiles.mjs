// A rough imitation of the engine's and common/profile's checks of a profile: enough to develop and test the editor.
import { layerNames } from '../../../client/web/app/lib/tissue.js';
import { typeFaultsOf } from './document_types.mjs';

/** @returns {{path: string, message: string, severity: string}[]} */
export function courseProblemsOf(course) {
  const faults = typeFaultsOf(course, 'Curriculum');
  if (faults.length > 0 || course.exercises?.length) return faults;
  return [{ path: 'exercises', message: 'at least one exercise is needed', severity: 'ERROR' }];
}

/** @returns {{path: string, message: string, severity: string}[]} */
export function problemsOf(document) {
  const faults = typeFaultsOf(document, 'Profile');
  return faults.length > 0 ? faults : profileProblems(document);
}

function profileProblems(profile) {
  const problems = [];
  const say = (path, message, severity = 'ERROR') => problems.push({ path, message, severity });
  const range = (path, value, [min, max], open) => {
    if (value === undefined) say(path, 'is missing');
    else if (typeof value !== 'number' || !(open ? value > min : value >= min) || !(value <= max))
      say(path, `${value} is out of range ${open ? '(' : '['}${min}, ${max}]`);
  };
  for (const key of ['id', 'name']) if (!profile[key]) say(key, 'is missing');
  if (profile.id && !/^[A-Za-z0-9._-]{1,64}$/.test(profile.id))
    say('id', `'${profile.id}' may hold letters, digits, '-', '_' and '.', at most 64`);
  range('needle.length_m', profile.needle?.length_m, [0, 1], true);
  if (!profile.layers?.length) say('layers', 'at least one layer is needed');
  profile.layers?.forEach((layer, i) => {
    const at = `layers[${i}]`;
    range(`${at}.thickness_m`, layer.thickness_m, [0, 1], true);
    if (layer.cutting_force_n !== undefined) range(`${at}.cutting_force_n`, layer.cutting_force_n, [0, 50]);
    if (layer.attracted_force_n !== undefined) range(`${at}.attracted_force_n`, layer.attracted_force_n, [0, 50]);
    if ((layer.rejection_force_n ?? 0) > Math.min(layer.cutting_force_n ?? 0, layer.attracted_force_n ?? 50))
      say(`${at}.rejection_force_n`, `${layer.rejection_force_n} N is above the lesser of cutting and attracted force`);
    const phi = fidelity(profile, i);
    if (phi !== null && phi < 0.5)
      say(
        `${at}.thickness_m`,
        `fidelity ${phi.toFixed(2)}: ${layer.thickness_m * 1000} mm are too thin to be felt at ${profile.tracking_wall?.stiffness_n_per_m} N/m`,
        'WARNING',
      );
  });
  range('tracking_wall.stiffness_n_per_m', profile.tracking_wall?.stiffness_n_per_m, [0, 10000], true);
  profile.targets?.forEach((target, i) => range(`targets[${i}].radius_m`, target.radius_m, [0, 1], true));
  profile.hazards?.forEach((hazard, i) => range(`hazards[${i}].radius_m`, hazard.radius_m, [0, 1], true));
  return problems;
}

/** Fidelity φ (db/samples/README.md); null if the force does not rise. */
export function fidelity(profile, i) {
  const force = profile.layers[i].cutting_force_n ?? 0,
    before = i ? (profile.layers[i - 1].cutting_force_n ?? 0) : 0;
  const stiffness = profile.tracking_wall?.stiffness_n_per_m,
    thickness = profile.layers[i].thickness_m;
  if (force <= before || !(stiffness > 0) || !(thickness > 0)) return null;
  return Math.max(0, Math.min(1, 1 - (force - before - 0.1 * force) / (stiffness * thickness)));
}

export function preview(profile) {
  const end = profile.layers.reduce((sum, l) => sum + l.thickness_m, 0);
  const n = 300,
    depth_m = [],
    total_n = [],
    by_effect = { CUTTING: [], SHAFT_FRICTION: [], PUNCTURE: [] };
  const layers = [],
    names = layerNames(profile);
  let from = 0;
  profile.layers.forEach((layer, i) => {
    layers.push({
      name: names[i],
      tissue: layer.tissue,
      from_m: from,
      to_m: from + layer.thickness_m,
      fidelity: fidelity(profile, i),
    });
    from += layer.thickness_m;
  });
  let wall = 0,
    friction = 0;
  for (let i = 0; i <= n; i++) {
    const depth = (end * i) / n;
    const at = layers.findIndex((l) => depth < l.to_m),
      index = at < 0 ? layers.length - 1 : at,
      layer = profile.layers[index];
    const most = (profile.tracking_wall?.stiffness_n_per_m ?? 500) * (end / n),
      goal = layer.cutting_force_n ?? 0;
    wall += Math.max(-most, Math.min(most, goal - wall));
    friction += (layer.friction_n_per_m ?? 0) * (end / n);
    const inside = depth - layers[index].from_m,
      p = layer.puncture;
    const pushed = p ? p.linear_n_per_m * inside + p.quadratic_n_per_m2 * inside * inside : 0;
    const puncture = p && pushed <= p.force_n ? pushed : 0;
    depth_m.push(depth);
    by_effect.CUTTING.push(wall);
    by_effect.SHAFT_FRICTION.push(friction);
    by_effect.PUNCTURE.push(puncture);
    total_n.push(Math.min(profile.max_force_n ?? 10, wall + friction + puncture));
  }
  return {
    depth_m,
    total_n,
    by_effect: Object.entries(by_effect).map(([effect, force_n]) => ({ effect, force_n })),
    layers,
    max_force_n: profile.max_force_n ?? 10,
  };
}

// "Try it": a simulated hand on the planned line of a body, its force, what it met, and which requirements of the
// patient's exercises that meets.
import { measureNamed, requirementText } from '../lib/measures.js';
import { kMeasures } from '../lib/measure_rows.js';
import { structureName } from '../lib/body.js';
import { atStart, counted, measureUnit, quantity } from '../lib/units.js';
import { exercises, measures } from '../net/requests.js';
import { useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';
import { Mark } from '../ui/widgets.js';
import { ForceOverDepth } from './preview.js';

const kOff_m = 0.001; // a plan that passes farther from the target is named

const sum = (a, b, share = 1) => ({ x: a.x + share * b.x, y: a.y + share * b.y, z: a.z + share * b.z });
const dot = (a, b) => a.x * b.x + a.y * b.y + a.z * b.z;
/** A point's distance from the segment from `a` along `way`. */
function fromSegment(p, a, way) {
  const square = dot(way, way),
    share = square > 0 ? Math.min(1, Math.max(0, dot(sum(p, a, -1), way) / square)) : 0;
  const off = sum(p, sum(a, way, share), -1);
  return Math.sqrt(dot(off, off));
}

/**
 * What the hand met on its way to the target.
 * @param {any} profile
 * @param {any} preview of the server
 * @param {any} plan of `planOf`
 */
export function triedOf(profile, preview, plan) {
  const reach_m = Math.min(plan.length_m, profile.needle?.length_m ?? 0),
    met = (preview.layers ?? []).filter((layer) => layer.from_m < reach_m - 1e-6),
    bones = met.filter(({ tissue }) => tissue === 'BONE');
  const isMet = (region) => {
    if (region.structure) return met.some(({ name }) => name === structureName(profile, region));
    if (region.anchor) return false; // where it is, only the engine knows
    const a = region.center_m ?? region.a_m,
      way = region.center_m ? { x: 0, y: 0, z: 0 } : sum(region.b_m, region.a_m, -1);
    return preview.depth_m.some((depth_m) => {
      const [x, y, z] = plan.direction.map((v) => v * Math.min(depth_m, reach_m));
      return fromSegment(sum(plan.entry_m, { x, y, z }), a, way) <= region.radius_m;
    });
  };
  const hazards = (profile.hazards ?? []).filter(isMet),
    too_short_m = plan.length_m - reach_m;
  return {
    met,
    hazards,
    too_short_m,
    values: {
      [kMeasures.force]: Math.max(0, ...preview.total_n.filter((_, i) => preview.depth_m[i] <= reach_m + 1e-6)),
      [kMeasures.target]: Number(bones.length === 0 && isMet(profile.targets[0])),
      [kMeasures.hazard]: hazards.length,
      [kMeasures.bone]: bones.length,
      [kMeasures.depth]: reach_m,
      entries: 1,
    },
  };
}

function Requirements({ exercise, values, kinds, plan }) {
  const rows = (exercise.requirements ?? []).map(({ measure, min, max }) => {
    const kind = measureNamed(kinds, measure, []) ?? { unit: '', words: measure },
      value = values[measure];
    const passed = value === undefined ? undefined : !(value < min) && !(value > max);
    return { words: kind.words, asked: requirementText({ measure, unit: kind.unit, min, max }), passed };
  });
  const judged = rows.filter(({ passed }) => passed !== undefined);
  const { entry_m, direction } = exercise.plan ?? {};
  const past =
    direction &&
    fromSegment(
      plan.target_m,
      entry_m,
      sum({ x: 0, y: 0, z: 0 }, direction, 1 / Math.hypot(direction.x, direction.y, direction.z)),
    );
  const others = rows.length - judged.length;
  return html`<h3>${exercise.name}</h3>
    ${
      past > kOff_m &&
      html`<p class="warning">! The exercise’s own line passes ${quantity(past, 'm')} beside this target: change it in the course.</p>`
    }
    <ul class="verdicts">${judged.map(
      ({ words, asked, passed }) =>
        html`<li><${Mark} kind=${passed ? 'good' : 'bad'}>${`${atStart(words)}: ${asked}`}<//></li>`,
    )}</ul>
    ${others > 0 && html`<p class="help">${counted(others, 'requirement')} more: only a person’s hand can meet them.</p>`}`;
}

/**
 * @param {{profile: any, rendered: any, plan: any, of: string[]}} props `rendered`: of `usePreview`; `of`: the patients whose exercises are meant
 */
export function TryIt({ profile, rendered, plan, of }) {
  const load = useLoad(async (signal) => ({ all: await exercises(signal), kinds: await measures(signal) }), []);
  const { preview, error } = rendered;
  if (!preview?.depth_m?.length || error)
    return html`<div class="trial"><${ForceOverDepth} ...${rendered} height=${150} total_only /></div>`;
  const { met, hazards, too_short_m, values } = triedOf(profile, preview, plan);
  const mine = (load.data?.all ?? []).filter(({ profile_id }) => of.includes(profile_id));
  const most = Math.min(
    ...mine
      .flatMap((e) => e.requirements ?? [])
      .filter((r) => r.measure === kMeasures.force && r.max)
      .map((r) => r.max),
  );
  const limits = Number.isFinite(most)
    ? [{ at: most / measureUnit('N').factor, label: `at most ${quantity(most, 'N')}` }]
    : [];
  return html`<div class="trial">
    <${ForceOverDepth}
      ...${rendered}
      title="Force of a steady hand at 10 mm/s on the planned line"
      height=${150}
      limits=${limits}
      total_only
    />
    <p>
      Met: ${met.map(({ name, from_m }) => `${name} at ${quantity(from_m, 'm', { digits: 2 })}`).join(', ')}.
      ${values[kMeasures.target] ? ' The target is reached.' : ' The target is not reached.'}
      ${` Greatest force ${quantity(values[kMeasures.force], 'N')}.`}
    </p>
    ${too_short_m > 1e-6 && html`<p class="error">✗ The needle is ${quantity(too_short_m, 'm')} too short.</p>`}
    ${hazards.length > 0 && html`<p class="error">✗ On the way: ${hazards.map(({ name }) => name).join(', ')}.</p>`}
    ${mine.map(
      (exercise) =>
        html`<${Requirements} key=${exercise.id} exercise=${exercise} values=${values} kinds=${load.data.kinds} plan=${plan} />`,
    )}
    ${load.data && mine.length === 0 && html`<p class="help">No exercise has this patient yet: nothing to judge the force by.</p>`}
  </div>`;
}

// Rules of a course beyond the ranges of single numbers, checked while the user types.
import { kMeasures } from './measure_rows.js';
import { isObject } from './shape.js';

/** @typedef {{path: string, message: string, severity: 'ERROR'}} Fault */

const kId = /^[A-Za-z0-9._-]{1,64}$/;

/** Whether `from` requires that `to` has been passed, directly or through other exercises. */
function leadsTo(exercises, from, to) {
  const seen = new Set(),
    open = [from];
  while (open.length > 0) {
    const id = open.pop();
    if (id === to) return true;
    if (seen.has(id)) continue;
    seen.add(id);
    open.push(...(exercises.find((e) => e.id === id)?.prerequisites ?? []));
  }
  return false;
}

/** Least length of the way to a point on the line, in m; a direction may have any length but 0, in any unit. */
const leastLength = (direction) => (direction ? Number.MIN_VALUE : 1e-6);

/** Faults of a plan that show without the patient; the server checks the plan against the skin. */
function planFaults(plan, at, say) {
  const axes = ['x', 'y', 'z'];
  const whole = (name) => {
    const missing = axes.filter((axis) => !Number.isFinite(plan[name]?.[axis]));
    missing.forEach((axis) => say(`${at}.${name}.${axis}`, 'is missing'));
    return missing.length === 0;
  };
  if (plan.frame !== 'LIMB') say(`${at}.frame`, "must be LIMB, the frame of the patient's coordinates");
  const has_entry = whole('entry_m');
  if (!plan.direction === !plan.target_m) return say(at, 'give either a direction or a point on the line');
  const name = plan.direction ? 'direction' : 'target_m';
  if (!whole(name)) return;
  const to = plan[name],
    from = plan.direction ? { x: 0, y: 0, z: 0 } : plan.entry_m;
  if (
    (plan.direction || has_entry) &&
    Math.hypot(...axes.map((axis) => to[axis] - from[axis])) < leastLength(plan.direction)
  )
    say(
      `${at}.${name}`,
      plan.direction
        ? 'has the length 0: give any vector that points into the tissue'
        : 'is the entry itself: give a point further along the line',
    );
}

/**
 * @param {any} course as a form shows it (lib/shape.js)
 * @param {{profiles?: string[], measures?: string[]}} known ids and names that exist; absent: not checked
 * @returns {Fault[]}
 */
export function courseFaults(course, { profiles, measures } = {}) {
  const faults = [];
  const say = (path, message) => faults.push({ path, message, severity: 'ERROR' });
  if (!kId.test(course.id ?? '')) say('id', "letters, digits, '-', '_', '.', 1 to 64 of them");
  if (!course.name?.trim()) say('name', 'is missing');
  if (course.results_from_unix_ms !== undefined && !course.exam)
    say('results_from_unix_ms', 'is for an exam, and this course is not one');
  const exercises = course.exercises ?? [];
  if (exercises.length === 0) say('exercises', 'a course needs at least one exercise');
  exercises.forEach((exercise, i) => {
    const at = `exercises[${i}]`;
    if (!kId.test(exercise.id ?? '')) say(`${at}.id`, "letters, digits, '-', '_', '.', 1 to 64 of them");
    else if (exercises.findIndex((e) => e.id === exercise.id) < i)
      say(`${at}.id`, `another exercise is also called ${exercise.id}`);
    if (!exercise.name?.trim()) say(`${at}.name`, 'is missing');
    if (!exercise.profile_id) say(`${at}.profile_id`, 'choose a patient');
    else if (profiles && !profiles.includes(exercise.profile_id))
      say(`${at}.profile_id`, `there is no profile ${exercise.profile_id}`);
    (exercise.prerequisites ?? []).forEach((id, k) => {
      if (id === undefined) return;
      const place = exercises.findIndex((e) => e.id === id);
      if (place < 0) say(`${at}.prerequisites[${k}]`, `there is no exercise ${id} in this course`);
      else if (leadsTo(exercises, id, exercise.id))
        say(
          `${at}.prerequisites[${k}]`,
          id === exercise.id
            ? 'an exercise cannot come before itself'
            : `${id} also needs this one first: neither could begin`,
        );
    });
    (exercise.requirements ?? []).forEach((rule, k) => {
      const here = `${at}.requirements[${k}]`;
      if (!rule.measure) say(`${here}.measure`, 'choose a measure');
      else if (measures && !measures.includes(rule.measure))
        say(`${here}.measure`, `no score has a measure ${rule.measure}`);
      else if (kMeasures.need_plan.includes(rule.measure) && !exercise.plan)
        say(`${here}.measure`, 'needs a planned line, and this exercise has none');
      if (rule.min === undefined && rule.max === undefined) say(`${here}.min`, 'give a least or a greatest value');
      if (rule.min !== undefined && rule.max !== undefined && rule.min > rule.max)
        say(`${here}.max`, 'the greatest value is below the least one');
    });
    if (exercise.plan) planFaults(exercise.plan, `${at}.plan`, say);
    if (
      exercise.attempts !== undefined &&
      !(Number.isInteger(exercise.attempts) && exercise.attempts >= 1 && exercise.attempts <= 1000)
    )
      say(`${at}.attempts`, 'a whole number from 1 to 1000, or nothing');
    if (exercise.time_limit_s !== undefined && !(exercise.time_limit_s > 0 && exercise.time_limit_s <= 86400))
      say(`${at}.time_limit_s`, 'more than 0 s and at most a day, or nothing');
    if (exercise.target_dwell_s !== undefined && !(exercise.target_dwell_s >= 0 && exercise.target_dwell_s <= 600))
      say(`${at}.target_dwell_s`, 'from 0 to 600 s, or nothing');
  });
  return faults;
}

/** The course after it stops being an exam: nothing is held back. */
export function withoutExam(course) {
  const { exam, results_from_unix_ms, ...rest } = course;
  return rest;
}

/** "2. Knee"; a name that already has a number stays as it is. */
export const numbered = (index, name) => (/^\d/.test(name) ? name : `${index + 1}. ${name}`);

/** What to call an exercise whose name or id may be missing. */
export const exerciseName = (exercise, index) => exercise?.name || exercise?.id || `Exercise ${index + 1}`;

/**
 * Whether a trainee has done an exercise, by the server's rules: passed; or tried, if nothing is required or an exam's
 * results are not shown yet.
 */
export function isDone(exercise, cell) {
  if (cell?.results_from_unix_ms) return cell.attempts > 0;
  const asks_nothing = !exercise.requirements?.length && (exercise.time_limit_s ?? null) === null;
  return cell?.passed ?? (asks_nothing && (cell?.attempts ?? 0) > 0);
}

/**
 * A trainee's next due date in a course: the earliest of the exercises that are not done; it may have passed.
 * @param {any[]} exercises of the course
 * @param {any[]} cells the trainee's results; `due_unix_ms` is from the assignment that counts, as the server decides
 * @returns {number|undefined} undefined: no date is left
 */
export function nextDue(exercises, cells) {
  const open = exercises
    .map((exercise) => ({ exercise, cell: cells.find((c) => c.exercise_id === exercise.id) }))
    .filter(({ exercise, cell }) => cell?.due_unix_ms && !isDone(exercise, cell));
  return open.length > 0 ? Math.min(...open.map(({ cell }) => cell.due_unix_ms)) : undefined;
}

/**
 * Gives a plan's line in the other way: `by` is 'direction' or 'target_m'; a point is put 30 mm along it. If a plan has
 * both, the chosen one stays.
 */
export function planGivenBy(plan, by) {
  const { direction, target_m, ...rest } = isObject(plan) ? plan : {};
  if (plan?.[by]) return { ...rest, [by]: plan[by] };
  const at = (v, axis) => Number(v?.[axis]) || 0;
  const along = ['x', 'y', 'z'].map((axis) =>
    direction ? at(direction, axis) : at(target_m, axis) - at(rest.entry_m, axis),
  );
  const size = Math.hypot(...along);
  // 12 digits, as in the fields
  const rounded = (value) => Number(value.toPrecision(12)) || 0;
  const vector = (of) => ({ x: rounded(of('x', 0)), y: rounded(of('y', 1)), z: rounded(of('z', 2)) });
  const one = size < leastLength(direction) ? [0, 0, -1] : along.map((v) => v / size);
  return {
    ...rest,
    [by]: by === 'direction' ? vector((_, i) => one[i]) : vector((axis, i) => at(rest.entry_m, axis) + 0.03 * one[i]),
  };
}

/** An unused id for a new exercise: "exercise-3". */
export function freshId(exercises, stem = 'exercise') {
  const taken = new Set(exercises.map((e) => e?.id));
  let n = exercises.length + 1;
  while (taken.has(`${stem}-${n}`)) n++;
  return `${stem}-${n}`;
}

const isPrerequisite = (id, e) => id !== undefined && Array.isArray(e?.prerequisites) && e.prerequisites.includes(id);

/** The exercises without the one at `index`, which is also removed from the others' prerequisites. */
export function withoutExercise(exercises, index) {
  const id = exercises[index]?.id;
  return exercises
    .filter((_, i) => i !== index)
    .map((e) => {
      if (!isPrerequisite(id, e)) return e;
      const { prerequisites, ...rest } = e;
      const left = prerequisites.filter((p) => p !== id);
      return left.length ? { ...rest, prerequisites: left } : rest;
    });
}

/** The exercises with a new id for one, also as a prerequisite of others. */
export function withExerciseId(exercises, index, id) {
  const before = exercises[index]?.id;
  return exercises.map((e, i) => {
    if (i === index) return { ...e, id };
    if (!isPrerequisite(before, e)) return e;
    return { ...e, prerequisites: e.prerequisites.map((p) => (p === before ? id : p)) };
  });
}

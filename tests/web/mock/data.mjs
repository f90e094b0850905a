// A small lab for the mock server: staff, twelve trainees, the sample profiles and course of db/samples, attempts.
import { readFileSync, readdirSync } from 'node:fs';
import { measureText } from '../../../client/web/app/lib/measures.js';
import { gesture, random } from './gesture.mjs';
import { bandsOf } from './section.mjs';

const kSamples = new URL('../../../db/samples/', import.meta.url);
const kDay_ms = 86_400_000;
export const kNow_ms = Date.UTC(2026, 10, 20, 9, 0);
export const kPassword = 'correct horse';

const read = (name) => JSON.parse(readFileSync(new URL(name, kSamples), 'utf8'));

const kStaff = [
  ['mara', 'Mara Lindqvist', 'CURRICULUM_MANAGER'],
  ['ines', 'Ines Ortega', 'INSTRUCTOR'],
  ['root', 'Ada Root', 'ADMINISTRATOR'],
  ['rhea', 'Rhea Sato', 'RESEARCHER'],
];
const kTrainees = [
  'Anna Bauer',
  'Ben Osei',
  'Chloe Martin',
  'David Kim',
  'Elif Demir',
  'Farid Haddad',
  'Greta Olsen',
  'Hugo Silva',
  'Irina Petrova',
  'Jonas Weber',
  'Kaito Mori',
  'Lena Fischer',
];

const nameOf = (full_name) => full_name.toLowerCase().replace(' ', '.');

const kMeasures = [
  ['target_reached', '', 'Target reached', (s) => (s.skill > 0.35 ? 1 : 0)],
  ['time_at_target_s', 's', 'Time at the target', (s) => 0.5 + 3 * s.skill],
  ['target_distance_m', 'm', "Distance from the target's centre at the deepest point", (s) => 0.004 * (1.1 - s.skill)],
  ['hazards_touched', '', 'Hazards touched', (s) => (s.skill < 0.25 ? 1 : 0)],
  ['elapsed_s', 's', 'Elapsed time', (s) => s.gesture.length_s],
  ['path_length_m', 'm', 'Path of the tip', (s) => 0.12 + 0.2 * (1 - s.skill)],
  ['time_in_tissue_s', 's', 'Time in tissue', (s) => s.gesture.length_s - 3.2],
  ['peak_speed_m_s', 'm/s', 'Peak speed', (s) => 0.03 + 0.08 * (1 - s.skill)],
  ['tissue_damage_m2', 'm^2', 'Tissue swept by the shaft', (s) => 1e-4 + 5e-4 * (1 - s.skill)],
  ['sparc', '', 'Smoothness (SPARC)', (s) => -2 - 5 * (1 - s.skill)],
  ['greatest_depth_m', 'm', 'Greatest depth', (s) => s.depth_m + 0.002 * (1 - s.skill)],
  ['peak_force_n', 'N', 'Peak force', (s) => Math.max(...s.gesture.columns.fz_n)],
  ['peak_force_layer_2_n', 'N', 'Peak force in layer 2', (s) => 0.8 + 0.5 * (1 - s.skill)],
  ['mean_force_in_tissue_n', 'N', 'Mean force in tissue', (s) => 1.1 + 0.6 * (1 - s.skill)],
  ['largest_lateral_error_m', 'm', "Largest distance from the needle's own line", (s) => 0.001 + 0.005 * (1 - s.skill)],
  ['entries', '', 'Entries', (s) => (s.skill < 0.4 ? 3 : 1)],
  ['trajectory_changes', '', 'Changes of trajectory', (s) => (s.skill < 0.5 ? 2 : 0)],
  ['aspirated_before_injection', '', 'Aspirated before the injection', (s) => (s.skill > 0.3 ? 1 : 0)],
  ['injected_in_target_share', '', 'Share of the injection in the target', (s) => Math.min(1, 0.4 + 0.7 * s.skill)],
];
const kMore = ['target_reached', 'time_at_target_s', 'injected_in_target_share'];
const betterOf = (name) => (kMore.includes(name) ? 'more' : 'less');
// as the server lists them: a measure of a layer is one row, with a K for the layer's number
export const measures = kMeasures.map(([name, unit, words]) => ({
  name: name.replace(/_layer_\d+_/, '_layer_K_'),
  unit,
  words: words.replace(/layer \d+/, 'layer K'),
  better: betterOf(name),
  definition: `${words}, as the mock makes it up`,
}));

const said = (measure, value, unit) => measureText(measure, value, unit).replaceAll('\u00a0', ' ');

export function scoreOf(session, exercise) {
  return kMeasures.map(([measure, unit, words, value_of]) => {
    const value = value_of(session);
    const rule = exercise.requirements?.find((r) => r.measure === measure);
    const row = { measure, value, unit, words };
    if (rule) {
      row.min = rule.min;
      row.max = rule.max;
      row.passed = (rule.min === undefined || value >= rule.min) && (rule.max === undefined || value <= rule.max);
      // as common/scoring/measures/score_report.cpp says it
      const asked = rule.min !== undefined;
      const verdict = asked ? ['at least', 'below', 'asked for'] : ['within', 'above', 'allowed'];
      row.words = `${words} ${said(measure, value, unit)}: ${verdict[row.passed ? 0 : 1]} the ${said(measure, rule.min ?? rule.max, unit)} ${verdict[2]}`;
    }
    return row;
  });
}

/** A score beside the range of the experts. */
export function comparisonOf(rows, bands) {
  return bands.map((band) => {
    const { measure, n, least, greatest } = band;
    const { value, unit, words } = rows.find((row) => row.measure === measure);
    const text = (v) => said(measure, v, unit);
    const side = value < least ? 'below' : value > greatest ? 'above' : 'within';
    // as common/scoring/attempts/reference.cpp says it
    const place = n < 5 || text(least) === text(greatest) ? null : side;
    const name = words.split(' ' + text(value))[0];
    return {
      measure,
      value,
      unit,
      n,
      least,
      greatest,
      place,
      better: betterOf(measure),
      words: place
        ? `${name} ${text(value)}: ${place} the experts' range, ${text(least)} to ${text(greatest)} (${n} gestures)`
        : '',
    };
  });
}

export function bandOf(sessions) {
  return kMeasures.map(([measure, unit, , value_of]) => {
    const values = sessions.map(value_of).sort((a, b) => a - b);
    const n = values.length,
      mean = values.reduce((a, b) => a + b, 0) / n;
    const at = (q) => values[Math.round(q * (n - 1))];
    // like the engine: leave out what too few sessions cannot tell
    return {
      measure,
      unit,
      n,
      mean,
      ...(n > 1 ? { sd: Math.sqrt(values.reduce((a, b) => a + (b - mean) ** 2, 0) / (n - 1)) } : {}),
      least: values[0],
      ...(n > 9 ? { p10: at(0.1) } : {}),
      ...(n > 3 ? { p25: at(0.25) } : {}),
      median: at(0.5),
      ...(n > 3 ? { p75: at(0.75) } : {}),
      ...(n > 9 ? { p90: at(0.9) } : {}),
      greatest: values.at(-1),
    };
  });
}

/** Everything that the lab remembers. */
export function makeLab() {
  const next = random(7);
  const people = new Map();
  for (const [name, full_name, role] of kStaff)
    people.set(name, {
      name,
      full_name,
      role,
      disabled: false,
      revision: 1,
      created_unix_ms: kNow_ms - 90 * kDay_ms,
      has_password: true,
      changed_unix_ms: kNow_ms - 90 * kDay_ms,
      changed_by: 'root',
      password: kPassword,
    });
  for (const [i, full_name] of kTrainees.entries()) {
    const name = nameOf(full_name);
    people.set(name, {
      name,
      full_name,
      role: 'TRAINEE',
      disabled: i === 11,
      revision: 1,
      ...(i % 3 === 0
        ? {}
        : { consent: { given: true, unix_ms: kNow_ms - 29 * kDay_ms, recorded_by: 'mara', note: 'signed paper' } }),
      created_unix_ms: kNow_ms - 30 * kDay_ms,
      has_password: i < 6,
      changed_unix_ms: kNow_ms - 30 * kDay_ms,
      changed_by: 'mara',
      password: kPassword,
    });
  }
  const trainees = kTrainees.map(nameOf);
  const groups = new Map([
    [
      'autumn-a',
      {
        id: 'autumn-a',
        name: 'Autumn course, group A',
        members: trainees.slice(0, 6),
        revision: 1,
        changed_unix_ms: kNow_ms - 25 * kDay_ms,
        changed_by: 'mara',
      },
    ],
    [
      'autumn-b',
      {
        id: 'autumn-b',
        name: 'Autumn course, group B',
        members: trainees.slice(6),
        revision: 2,
        changed_unix_ms: kNow_ms - 25 * kDay_ms,
        changed_by: 'mara',
      },
    ],
  ]);
  const profiles = new Map();
  for (const file of readdirSync(kSamples).filter((n) => n.endsWith('.json') && !n.endsWith('curriculum.json'))) {
    const profile = read(file);
    profiles.set(profile.id, [
      { revision: 1, created_unix_ms: kNow_ms - 60 * kDay_ms, author: 'sample', json: profile },
    ]);
  }
  const older = profiles.get('shoulder-adult')[0];
  const revised = structuredClone(older.json);
  revised.layers[0].cutting_force_n = 0.9;
  revised.layers[2].thickness_m = 0.015;
  revised.description += ' Deltoid a millimetre thicker after the pilot.';
  profiles
    .get('shoulder-adult')
    .push({ revision: 2, created_unix_ms: kNow_ms - 9 * kDay_ms, author: 'mara', json: revised });

  const course = read('curriculum.json');
  course.exercises.forEach((exercise, i) => {
    if (i > 0) exercise.prerequisites = [course.exercises[i - 1].id];
    exercise.attempts = i < 2 ? undefined : 5;
    exercise.due_unix_ms = kNow_ms + (i + 1) * 7 * kDay_ms;
  });
  const courses = new Map([
    [course.id, [{ revision: 1, created_unix_ms: kNow_ms - 40 * kDay_ms, author: 'mara', json: course }]],
  ]);

  const sessions = [];
  trainees.slice(0, 11).forEach((trainee, who) => {
    const done = 1 + (who % 5);
    course.exercises.slice(0, done).forEach((exercise, step) => {
      const target = profiles.get(exercise.profile_id)[0].json.targets?.[0];
      for (let attempt = 0; attempt < 2 + (who % 2); attempt++) {
        const skill = Math.min(0.98, 0.1 + 0.06 * who + 0.22 * attempt + 0.05 * next());
        const depth_m = Math.abs(target?.center_m.z ?? -0.02);
        const number = sessions.length + 1;
        const session = {
          session_id: `019a9c00-0000-7000-8000-${String(number).padStart(12, '0')}`,
          trainee,
          exercise_id: exercise.id,
          skill,
          depth_m,
          started_unix_ms: kNow_ms - (20 - step * 3) * kDay_ms + attempt * 3_600_000 + who * 600_000,
          station: `bench-${1 + (who % 4)}`,
          profile_id: exercise.profile_id,
          profile_revision: 1,
          gesture: gesture(profiles.get(exercise.profile_id)[0].json, { seed: number, skill, depth_m }),
        };
        sessions.push(session);
      }
    });
  });
  const body = read('volumes/lumbar-median.json'),
    of_body = { seed: sessions.length + 1, skill: 0.9, depth_m: 0.051 };
  sessions.push({
    ...sessions.at(-1),
    ...of_body,
    session_id: '019a9c00-0000-7000-8000-0000000b0d1e',
    exercise_id: 'lumbar-epidural',
    started_unix_ms: kNow_ms - kDay_ms,
    profile_id: body.id,
    profile: body, // no other page shows it
    gesture: gesture(bandsOf(body), of_body),
  });
  const annotations = new Map([
    [
      sessions[0].session_id,
      [
        {
          id: 1,
          session_id: sessions[0].session_id,
          tick: 4200,
          t_s: 4.2,
          text: 'Slow down before the capsule.',
          author: 'ines',
          created_unix_ms: sessions[0].started_unix_ms + 60_000,
        },
      ],
    ],
  ]);
  const assignments = [
    {
      id: 1,
      course_id: course.id,
      exercise_id: '',
      group_id: 'autumn-a',
      trainee: '',
      by: 'mara',
      created_unix_ms: kNow_ms - 25 * kDay_ms,
      due_unix_ms: kNow_ms + 40 * kDay_ms,
    },
    {
      id: 2,
      course_id: course.id,
      exercise_id: '',
      group_id: 'autumn-b',
      trainee: '',
      by: 'mara',
      created_unix_ms: kNow_ms - 25 * kDay_ms,
      due_unix_ms: kNow_ms + 40 * kDay_ms,
    },
    {
      id: 3,
      course_id: '',
      exercise_id: 'knee-recess',
      group_id: '',
      trainee: 'anna.bauer',
      by: 'ines',
      created_unix_ms: kNow_ms - 3 * kDay_ms,
      due_unix_ms: null,
    },
  ];
  const audit = Array.from({ length: 140 }, (_, i) => ({
    id: i + 1,
    unix_ms: kNow_ms - (140 - i) * 3_500_000,
    who: ['mara', 'ines', 'root'][i % 3],
    action: ['profile import', 'annotate', 'user add', 'assign', 'backup'][i % 5],
    subject: ['shoulder-adult', sessions[0].session_id, trainees[i % 12], course.id, '/var/backups/needlelab'][i % 5],
    detail: ['revision 2', '', 'trainee', 'group autumn-a', '12.4 MB, verified'][i % 5],
  }));
  return {
    people,
    groups,
    profiles,
    courses,
    sessions,
    annotations,
    assignments,
    audit,
    references: new Map(),
    logins: new Map(),
    failures: new Map(),
  };
}

// The REST table of the server over the mock's lab: [method, path, roles, handler]. Replies as server/web writes them.
import { bandOf, comparisonOf, kNow_ms, measures, scoreOf } from './data.mjs';
import { courseProblemsOf, preview, problemsOf } from './profiles.mjs';
import { sectionOf } from './section.mjs';

const kStaff = ['INSTRUCTOR', 'CURRICULUM_MANAGER', 'ADMINISTRATOR'],
  kManagers = kStaff.slice(1),
  kAdmin = ['ADMINISTRATOR'];
const kPeople = [...kStaff, 'TRAINEE'],
  kAll = [...kPeople, 'RESEARCHER'];

export class Refusal extends Error {
  constructor(status, code, message, more = {}) {
    super(message);
    Object.assign(this, { status, code, more });
  }
}
const missing = (what) => new Refusal(404, 'not_found', `${what} is not there`);
const found = (map, key, what) =>
  map.get(key) ??
  (() => {
    throw missing(`${what} '${key}'`);
  })();

const withoutPassword = (lab, { password, code, ...person }) => ({
  ...person,
  id: `@${[...lab.people.keys()].indexOf(person.name) + 1}`,
  has_code: !!code,
  groups: [...lab.groups.values()].filter((g) => g.members.includes(person.name)).map((g) => g.id),
  more_groups: 0,
});

const kSettings = { codes_required: false, keep_recordings_of_erased: false };

/** Names of groups that have one of the words. */
const mentionsOf = (lab, words) =>
  [...lab.groups.values()]
    .filter((g) => words.some((word) => word && g.name.toLowerCase().includes(word.toLowerCase())))
    .map((g) => ({
      where: `group ${g.id}`,
      about: `the name of group '${g.id}'`,
      text: g.name,
      link: `#/groups/${g.id}`,
      times: 1,
    }));

const changedBy = (who) => ({ changed_unix_ms: Date.now(), changed_by: who });

function paged(items, query, usual = 50) {
  const size = Number(query.limit) || usual;
  const begin = Number(query.page ?? 0) || 0;
  return {
    items: items.slice(begin, begin + size),
    next_page: begin + size < items.length ? String(begin + size) : '',
  };
}

/** Keeps the person's place, which is the id. */
function rename(lab, person, name) {
  if (lab.people.has(name)) throw new Refusal(409, 'conflict', `'${name}' is there already`);
  const was = person.name;
  const people = [...lab.people.values()];
  person.name = name;
  lab.people.clear();
  for (const one of people) lab.people.set(one.name, one);
  for (const g of lab.groups.values()) g.members = g.members.map((member) => (member === was ? name : member));
  for (const session of lab.sessions) if (session.trainee === was) session.trainee = name;
}

/** Stores a new revision of a document, unless another one came first. */
function putRevision(map, id, base, json, who) {
  const revisions = map.get(id) ?? [];
  if (base === undefined)
    throw new Refusal(400, 'invalid_input', 'If-Match: give the revision that was changed; "0" for something new');
  if (base !== revisions.length) {
    throw new Refusal(
      409,
      'conflict',
      `'${id}' was changed by ${revisions.at(-1)?.author} in the meantime: revision ${revisions.length}, not ${base}`,
      { current_revision: revisions.length },
    );
  }
  map.set(id, [...revisions, { revision: revisions.length + 1, created_unix_ms: Date.now(), author: who, json }]);
  const { revision, created_unix_ms, author } = map.get(id).at(-1);
  return { id, revision, created_unix_ms, author };
}
const newest = (map, id, what) => found(map, id, what).at(-1);
const textOf = (id, text) => ({ id, ...text });
const revisionAsked = (map, id, query, what) => {
  const all = found(map, id, what);
  const text = query.revision ? all[Number(query.revision) - 1] : all.at(-1);
  if (!text) throw missing(`revision ${query.revision} of ${what} '${id}'`);
  return textOf(id, text);
};
const revisionList = (map, id, what) => ({
  items: found(map, id, what)
    .map(({ json, ...rest }) => ({ ...rest, name: json.name }))
    .reverse(),
  next_page: '',
});

const exerciseOf = (lab, id) => {
  for (const revisions of lab.courses.values()) {
    const exercise = revisions.at(-1).json.exercises.find((e) => e.id === id);
    if (exercise) return exercise;
  }
  throw missing(`exercise '${id}'`);
};
const sessionOf = (lab, id, who) => {
  const session = lab.sessions.find((s) => s.session_id === id);
  if (!session) throw missing(`session '${id}'`);
  if (who.role === 'TRAINEE' && session.trainee !== who.name)
    throw new Refusal(403, 'role', "this session is somebody else's");
  return session;
};
const scored = (lab, session) => scoreOf(session, exerciseOf(lab, session.exercise_id));
const scoreReply = (lab, s, first) => {
  const rows = scored(lab, s),
    bands = lab.references.get(s.exercise_id)?.bands;
  return {
    session_id: s.session_id,
    definition_version: 1,
    measures: rows,
    passed: passedOf(rows),
    made_unix_ms: first ? s.started_unix_ms + 60_000 : Date.now(),
    first,
    engine_version: '0.1.0',
    comparison: bands ? comparisonOf(rows, bands) : null,
    pending: [],
  };
};
const passedOf = (rows) => rows.every((row) => row.passed !== false);
const profileOf = (lab, s) => s.profile ?? lab.profiles.get(s.profile_id)[0].json;
const fullName = (lab, trainee) => lab.people.get(trainee)?.full_name ?? '';
const infoOf = (lab, s) => ({
  description: {
    session_id: s.session_id,
    station: s.station,
    trainee: s.trainee,
    trainee_full_name: fullName(lab, s.trainee),
    exercise_id: s.exercise_id,
    profile_id: s.profile_id,
    profile_revision: s.profile_revision,
    profile: profileOf(lab, s),
    engine_version: '0.1.0',
    rate_hz: 1000,
    resolution: { length_m: 1e-6, quaternion: 2 ** -15, force_n: 1e-3, torque_nm: 1e-4, time_s: 1e-6, speed_m_s: 1e-4 },
    started_unix_ms: s.started_unix_ms,
    started_steady_ns: 0,
    begin_clock: 'SERVER_CLOCK',
    placement: [],
    tool: [],
    device_notes: [],
    code_checked: false,
    capped_on_pieces: false,
    device: 'Virtuose 6D Desktop (simulated)',
    axial_model: 'ENHANCED_TRACKING_WALL',
    live_effects: ['CUTTING', 'ATTRACTED', 'CLAMPING', 'PUNCTURE'],
  },
  state: 'SESSION_COMPLETE',
  chunks: Math.ceil(s.gesture.length_s),
  samples: Math.round(s.gesture.length_s * 1000),
  hash: 'ab'.repeat(32),
  clock_offset_ns: 0,
  clock_round_trip_ns: 0,
  received_unix_ms: s.started_unix_ms,
  closed_unix_ms: s.started_unix_ms + s.gesture.length_s * 1000,
  stored_bytes: 412_000,
  score: scored(lab, s),
  passed: passedOf(scored(lab, s)),
  figures: [],
  ...(s.unknown_trainee ? { unknown_trainee: true } : {}),
  code_unchecked: !!s.code_unchecked,
  begin_unsure: !!s.begin_unsure,
  not_assigned: !!s.not_assigned,
  results_from_unix_ms: null,
  quarantined_chunks: s.quarantined_chunks ?? 0,
  ...(s.given_trainee ? { given_trainee: s.given_trainee } : {}),
});
/** A session as lists have it: the main figures instead of the score. */
const rowOf = (lab, s) => ({
  ...infoOf(lab, s),
  score: null,
  figures: scored(lab, s)
    .filter((r) => ['elapsed_s', 'peak_force_n', 'target_distance_m'].includes(r.measure))
    .map(({ measure, value, unit }) => ({ measure, value, unit })),
});
const kVerdicts = { passed: true, failed: false };
function isAsked(lab, s, query, who) {
  const person = lab.people.get(s.trainee),
    part = (query.search ?? '').toLowerCase();
  return (
    (!query.trainee || s.trainee === query.trainee) &&
    (!query.exercise || s.exercise_id === query.exercise) &&
    (who.role !== 'TRAINEE' || s.trainee === who.name) &&
    (!query.from_ms || s.started_unix_ms >= Number(query.from_ms)) &&
    (!query.to_ms || s.started_unix_ms < Number(query.to_ms)) &&
    (!query.verdict || passedOf(scored(lab, s)) === kVerdicts[query.verdict]) &&
    (s.trainee.toLowerCase().includes(part) || (person?.full_name ?? '').toLowerCase().includes(part))
  );
}
const attemptOf = (lab, s) => {
  const score = scored(lab, s);
  const number = lab.sessions.filter(
    (o) => o.trainee === s.trainee && o.exercise_id === s.exercise_id && o.started_unix_ms <= s.started_unix_ms,
  ).length;
  return {
    session_id: s.session_id,
    trainee: s.trainee,
    trainee_full_name: fullName(lab, s.trainee),
    exercise_id: s.exercise_id,
    number,
    started_unix_ms: s.started_unix_ms,
    passed: passedOf(score),
    state: 'SESSION_COMPLETE',
    excused: !!s.excused,
    beyond: false,
    results_from_unix_ms: null,
    score,
    profile_revision: s.profile_revision,
    engine_version: '0.1.0',
    late: false,
  };
};

function resultsOf(lab, query, who) {
  const course = newest(lab.courses, query.course, 'course').json;
  const members = query.group
    ? found(lab.groups, query.group, 'group').members
    : [...lab.people.values()].filter((p) => p.role === 'TRAINEE').map((p) => p.name);
  const rows = members
    .filter((m) => who.role !== 'TRAINEE' || m === who.name)
    .map((trainee) => {
      const cells = course.exercises.map((exercise) => {
        const attempts = lab.sessions
          .filter((s) => s.trainee === trainee && s.exercise_id === exercise.id)
          .map((s) => attemptOf(lab, s));
        const passed = attempts.some((a) => a.passed);
        return {
          exercise_id: exercise.id,
          attempts: attempts.length,
          ...(attempts.length ? { passed, best: attempts.find((a) => a.passed) ?? attempts.at(-1) } : {}),
          locked_by: [],
          ...(exercise.attempts ? { attempts_left: Math.max(0, exercise.attempts - attempts.length) } : {}),
          due_unix_ms: exercise.due_unix_ms ?? null,
          overdue: false,
          done: passed,
          results_from_unix_ms: null,
        };
      });
      cells.forEach((cell, i) => {
        cell.locked_by = (course.exercises[i].prerequisites ?? []).filter(
          (id) => !cells.find((c) => c.exercise_id === id)?.passed,
        );
      });
      return { trainee, full_name: lab.people.get(trainee)?.full_name ?? '', cells, groups: [] };
    });
  const { items, next_page } = paged(rows, query);
  const passed = course.exercises.map((_, i) => rows.filter((r) => r.cells[i].passed).length);
  const totals = !query.page && who.role !== 'TRAINEE';
  return {
    exercise_ids: course.exercises.map((e) => e.id),
    exercise_names: course.exercises.map((e) => e.name),
    rows: items,
    next_page,
    trainees_passed: totals ? passed : [],
    required_measures: [],
    ...(totals && { trainees: rows.length }),
  };
}

function importPeople(lab, { csv, dry_run }) {
  const [header, ...lines] = csv.trim().split(/\r?\n/);
  const columns = header.split(',').map((c) => c.trim());
  if (!columns.includes('name'))
    throw new Refusal(400, 'invalid_input', "the header has no column 'name'", { field: 'csv' });
  const count = { added: 0, changed: 0, unchanged: 0, faults: 0 },
    doing = [];
  const rows = lines.map((line, i) => {
    const v = Object.fromEntries(line.split(',').map((cell, c) => [columns[c], cell.trim()]));
    const row = (what, text, column = '') => ({ line: i + 2, name: v.name ?? '', what, text, column });
    const role = (v.role || 'trainee').toUpperCase().replaceAll('-', '_');
    if (!/^[a-z0-9._-]+$/.test(v.name ?? '')) {
      count.faults++;
      return row('FAULT', `'${v.name}' is no name: small letters, digits, '.', '-', '_'`, 'name');
    }
    if (!kAll.includes(role)) {
      count.faults++;
      return row('FAULT', `'${v.role}' is no role: trainee, instructor, curriculum-manager`, 'role');
    }
    const there = lab.people.get(v.name);
    const code_taken = v.code && !there?.code;
    if (there && !code_taken && there.full_name === (v.full_name || there.full_name)) {
      count.unchanged++;
      return row('NOTHING', 'is there already, with the same data');
    }
    count[there ? 'changed' : 'added']++;
    doing.push(() => {
      lab.people.set(v.name, {
        ...(there ?? {
          name: v.name,
          disabled: false,
          revision: 1,
          ...changedBy('mara'),
          created_unix_ms: Date.now(),
          has_password: !!v.password,
          password: v.password,
        }),
        ...(code_taken ? { code: v.code } : {}),
        full_name: v.full_name || (there?.full_name ?? ''),
        role,
      });
      if (v.group && !lab.groups.has(v.group))
        lab.groups.set(v.group, { id: v.group, name: v.group, members: [], revision: 1, ...changedBy('mara') });
      if (v.group && !lab.groups.get(v.group).members.includes(v.name)) lab.groups.get(v.group).members.push(v.name);
    });
    return row(
      there ? 'CHANGE' : 'ADD',
      there
        ? [code_taken && 'given the code', v.full_name && 'full name'].filter(Boolean).join('; ')
        : `new ${role.toLowerCase()}${v.group ? `, joins ${v.group}` : ''}`,
    );
  });
  const done = !dry_run && count.faults === 0;
  if (done) doing.forEach((act) => act());
  return {
    rows: rows.sort((a, b) => (b.what === 'FAULT') - (a.what === 'FAULT')),
    ...count,
    done,
    roles_changed: [],
    rows_left_out: 0,
    rights_given: 0,
  };
}

function samplesOf(session, query) {
  const { columns } = session.gesture;
  const from = Number(query.from_s ?? 0),
    to = Number(query.to_s ?? Infinity),
    points = Number(query.points ?? 2000);
  const inside = columns.t_s.map((t, i) => i).filter((i) => columns.t_s[i] >= from && columns.t_s[i] <= to);
  const step = Math.max(1, Math.ceil(inside.length / points));
  return {
    rate_hz: 1000,
    samples: Math.round(session.gesture.length_s * 1000),
    decimated: step > 1,
    from_s: columns.t_s[inside[0]] ?? 0,
    to_s: columns.t_s[inside.at(-1)] ?? 0,
    columns: Object.fromEntries(
      Object.entries(columns).map(([name, values]) => [
        name,
        inside.filter((_, k) => k % step === 0).map((i) => values[i]),
      ]),
    ),
  };
}

const place = (s, target) => ({
  x_m: 0,
  y_m: 0,
  z_m: -s.depth_m,
  in_tissue: true,
  layer: 3,
  tissue: 'BURSA',
  layer_name: 'bursa',
  insertion_m: s.depth_m,
  depth_m: s.depth_m,
  target,
  target_distance_m: -0.0004,
  hazard: '',
});

const route = (method, path, roles, reply, status) => [method, path, roles, reply, status];
const get = (path, roles, reply) => route('GET', path, roles, reply);
const post = (path, roles, reply) => route('POST', path, roles, reply);
const create = (path, roles, reply) => route('POST', path, roles, reply, 201);
const put = (path, roles, reply) => route('PUT', path, roles, reply);
const patch = (path, roles, reply) => route('PATCH', path, roles, reply);
const remove = (path, roles, reply) => route('DELETE', path, roles, reply);

/** @type {[string, string, string[], (c: any) => any, number?][]} c: {lab, who, params, query, body, base}; the status where it is not 200 */
export const kTable = [
  get('people', kStaff, ({ lab, query }) => {
    const has = (p) => `${p.name}\n${p.full_name}\n${p.groups.join('\n')}`.toLowerCase();
    const all = [...lab.people.values()]
      .map((p) => withoutPassword(lab, p))
      .filter((p) => !query.role || p.role === query.role.toUpperCase().replaceAll('-', '_'))
      .filter((p) => has(p).includes((query.search ?? '').toLowerCase()));
    return { ...paged(all, query, 8), ...(!query.page && { total: all.length }) };
  }),
  create('people', kManagers, ({ lab, body, who }) => {
    if (!/^[a-z0-9._-]{1,64}$/.test(body.name ?? ''))
      throw new Refusal(400, 'invalid_input', `name: '${body.name}' may hold small letters, digits, '.', '-' and '_'`, {
        field: 'name',
      });
    if (lab.people.has(body.name)) throw new Refusal(409, 'conflict', `'${body.name}' is there already`);
    lab.people.set(body.name, {
      full_name: '',
      role: 'TRAINEE',
      disabled: false,
      revision: 1,
      ...changedBy(who.name),
      created_unix_ms: Date.now(),
      has_password: !!body.password,
      ...body,
    });
    return { name: body.name, role: lab.people.get(body.name).role };
  }),
  post('people/import', kManagers, ({ lab, body }) => importPeople(lab, body)),
  get('people/:name', kAll, ({ lab, params, who }) => {
    if (['TRAINEE', 'RESEARCHER'].includes(who.role) && params.name !== who.name)
      throw new Refusal(403, 'role', 'trainees and researchers see themselves only');
    return withoutPassword(lab, found(lab.people, params.name, 'person'));
  }),
  patch('people/:name', kPeople, ({ lab, params, body, who, base }) => {
    const person = found(lab.people, params.name, 'person');
    if (base === undefined && body.consent === undefined)
      throw new Refusal(400, 'invalid_input', 'If-Match: give the revision that was changed');
    if (base !== undefined && body.consent === undefined && base !== person.revision)
      throw new Refusal(409, 'conflict', 'somebody else changed this person', { current_revision: person.revision });
    const { consent, new_name, ...rest } = body;
    if (new_name) rename(lab, person, new_name);
    Object.assign(
      person,
      rest,
      consent === undefined
        ? {}
        : { consent: { given: consent, unix_ms: Date.now(), recorded_by: who.name, note: '' } },
    );
    if (consent === undefined) Object.assign(person, { revision: person.revision + 1 }, changedBy(who.name));
    return withoutPassword(lab, person);
  }),
  post('people/:name/password', kAll, ({ lab, params, body, who }) => {
    const person = found(lab.people, params.name, 'person');
    if (who.name === params.name && !body.old_password)
      throw new Refusal(
        400,
        'invalid_input',
        'old_password: is missing: to change your own password, give the present one, too',
      );
    if (who.name === params.name && person.password && person.password !== body.old_password)
      throw new Refusal(403, 'denied', `old_password: is not the password of '${params.name}'`);
    Object.assign(person, { password: body.password, has_password: true });
    return {};
  }),
  post('people/:name/code', kAll, ({ lab, params, body, who }) => {
    if (!kManagers.includes(who.role) && params.name !== who.name)
      throw new Refusal(403, 'denied', 'only curriculum managers and administrators set the codes of other people');
    const person = found(lab.people, params.name, 'person');
    const code = body.make ? String(Math.floor(Math.random() * 1e6)).padStart(6, '0') : (body.code ?? '');
    if (code && !/^[ -~]{4,64}$/.test(code))
      throw new Refusal(400, 'invalid_input', `code: has ${code.length} characters, allowed are 4 to 64`, {
        field: 'code',
      });
    person.code = code;
    return { name: params.name, code: body.make ? code : '' };
  }),
  get('lab/settings', kAll, ({ lab }) => ({ ...kSettings, ...lab.settings })),
  patch('lab/settings', kAdmin, ({ lab, body }) => {
    lab.settings = { ...kSettings, ...lab.settings, ...body };
    return lab.settings;
  }),
  get('people/:name/export', kPeople, ({ lab, params }) => ({
    items: [{ kind: 'person', ...withoutPassword(lab, found(lab.people, params.name, 'person')) }],
  })),
  get('people/:name/mentions', kAdmin, ({ lab, params, query }) => {
    found(lab.people, params.name, 'person');
    return { items: mentionsOf(lab, [params.name, query.text]), next_page: '' };
  }),
  post('people/:name/mentions', kAdmin, ({ lab, params, body }) => {
    found(lab.people, params.name, 'person');
    const group = lab.groups.get(body.where.replace('group ', ''));
    if (!group) throw new Refusal(404, 'not_found', `there is no ${body.where}: list the texts again`);
    for (const word of [params.name, body.text].filter(Boolean))
      group.name = group.name.replace(word, '[name removed]');
    return {};
  }),
  remove('people/:name/data', kAdmin, ({ lab, params, body }) => {
    found(lab.people, params.name, 'person');
    if (body?.confirm !== params.name)
      throw new Refusal(400, 'invalid_input', 'confirm: must be the name', { field: 'confirm' });
    lab.people.delete(params.name);
    return {
      pseudonym: 'erased person 7',
      sessions: 3,
      recordings: 3,
      scores: 3,
      remarks_kept: 1,
      waiting_sessions: body.with_waiting_sessions ? 0 : 1,
      text: 'Backups made before today still hold the data.',
      pending: false,
    };
  }),
  get('people/:name/progress', kPeople, ({ lab, params, query }) => {
    if (query.newest_first === 'yes' && !query.exercise)
      throw new Refusal(400, 'invalid_input', 'exercise_id: is missing: attempts of all exercises come oldest first');
    const items = lab.sessions
      .filter((s) => s.trainee === params.name && (!query.exercise || s.exercise_id === query.exercise))
      .map((s) => attemptOf(lab, s));
    return { ...paged(query.newest_first === 'yes' ? items.reverse() : items, query, 200), measures: null };
  }),
  get('people/:name/exercises', kPeople, ({ lab, params }) => {
    const rows = new Map();
    for (const s of lab.sessions.filter((one) => one.trainee === params.name)) {
      const row = rows.get(s.exercise_id) ?? { exercise_id: s.exercise_id, attempts: 0, newest_unix_ms: 0 };
      const newest_unix_ms = Math.max(row.newest_unix_ms, s.started_unix_ms);
      rows.set(s.exercise_id, { ...row, attempts: row.attempts + 1, newest_unix_ms });
    }
    return { items: [...rows.values()].sort((a, b) => b.newest_unix_ms - a.newest_unix_ms), next_page: '' };
  }),
  get('today', kStaff, ({ lab, query, who }) => {
    const trainees = [...lab.people.values()].filter((p) => p.role === 'TRAINEE');
    const row = ({ name, full_name }, exercise_id, more) => ({
      trainee: name,
      trainee_full_name: full_name,
      exercise_ids: [exercise_id],
      due_unix_ms: null,
      measure: '',
      ...more,
    });
    const [exercise] = [...lab.courses.values()][0].at(-1).json.exercises;
    const lists = {
      due: trainees.slice(0, 3).map((p) => row(p, exercise.id, { due_unix_ms: kNow_ms + 3 * 86_400_000 })),
      behind: trainees.slice(1, 2).map((p) => row(p, exercise.id, { due_unix_ms: kNow_ms - 86_400_000 })),
      struggling: trainees.slice(0, 1).map((p) => row(p, exercise.id, { measure: 'peak_force_n' })),
    };
    return {
      due: lists.due.length,
      behind: lists.behind.length,
      struggling: lists.struggling.length,
      ...(kManagers.includes(who.role) && {
        waiting: lab.sessions.filter((s) => s.unknown_trainee).length,
        backup_unix_ms: kNow_ms - 2 * 86_400_000,
      }),
      ...paged(lists[query.list] ?? [], query),
    };
  }),
  get('groups', kStaff, ({ lab, query }) => {
    const part = (query.search ?? '').toLowerCase();
    const fitting = [...lab.groups.values()].filter((g) => `${g.id}\n${g.name}`.toLowerCase().includes(part));
    const brief = (g) => ({ ...g, members: [], member_count: g.members.length });
    return paged(query.brief === 'yes' ? fitting.map(brief) : fitting, query);
  }),
  create('groups', kManagers, ({ lab, body, who }) => {
    if (lab.groups.has(body.id))
      throw new Refusal(409, 'conflict', `group '${body.id}' is there already`, {
        current_revision: lab.groups.get(body.id).revision,
      });
    lab.groups.set(body.id, { members: [], ...body, revision: 1, ...changedBy(who.name) });
    return lab.groups.get(body.id);
  }),
  get('groups/:id', kStaff, ({ lab, params }) => found(lab.groups, params.id, 'group')),
  put('groups/:id', kManagers, ({ lab, params, body, base, who }) => {
    const group = found(lab.groups, params.id, 'group');
    if (base !== group.revision)
      throw new Refusal(409, 'conflict', `group '${params.id}' was changed in the meantime`, {
        current_revision: group.revision,
      });
    lab.groups.set(params.id, { ...group, ...body, revision: group.revision + 1, ...changedBy(who.name) });
    return lab.groups.get(params.id);
  }),
  remove('groups/:id', kManagers, ({ lab, params, base }) => {
    const group = found(lab.groups, params.id, 'group');
    if (base !== group.revision)
      throw new Refusal(409, 'conflict', `group '${params.id}' was changed in the meantime`, {
        current_revision: group.revision,
      });
    lab.groups.delete(params.id);
    return {};
  }),
  get('profiles', kAll, ({ lab }) => ({
    items: [...lab.profiles].map(([id, r]) => ({
      id,
      revision: r.length,
      name: r.at(-1).json.name,
      created_unix_ms: r.at(-1).created_unix_ms,
      author: r.at(-1).author,
    })),
    next_page: '',
  })),
  post('profiles/check', kStaff, ({ body }) => {
    const all = problemsOf(body),
      errors = all.filter((p) => p.severity === 'ERROR');
    return {
      ok: errors.length === 0,
      problems: errors.map(({ path, message }) => ({ path, message })),
      warnings: all.filter((p) => p.severity === 'WARNING').map((p) => `${p.path}: ${p.message}`),
    };
  }),
  post('profiles/preview', kStaff, ({ body }) => {
    const [problem] = problemsOf(body).filter((p) => p.severity === 'ERROR');
    if (problem)
      throw new Refusal(400, 'invalid_input', `${problem.path}: ${problem.message}`, { field: problem.path });
    return preview(body);
  }),
  get('profiles/:id', kAll, ({ lab, params, query }) => ({
    ...revisionAsked(lab.profiles, params.id, query, 'profile'),
    warnings: [],
  })),
  put('profiles/:id', kManagers, ({ lab, params, body, base, who }) => {
    const [problem] = problemsOf(body).filter((p) => p.severity === 'ERROR');
    if (problem)
      throw new Refusal(400, 'invalid_input', `${problem.path}: ${problem.message}`, { field: problem.path });
    return { ...putRevision(lab.profiles, params.id, base, body, who.name), warnings: [] };
  }),
  get('profiles/:id/revisions', [...kStaff, 'RESEARCHER'], ({ lab, params }) =>
    revisionList(lab.profiles, params.id, 'profile'),
  ),
  get('courses', kAll, ({ lab }) => ({
    items: [...lab.courses].map(([id, r]) => ({
      id,
      name: r.at(-1).json.name,
      revision: r.length,
      exercise_ids: r.at(-1).json.exercises.map((e) => e.id),
      exam: !!r.at(-1).json.exam,
      created_unix_ms: r.at(-1).created_unix_ms,
      author: r.at(-1).author,
    })),
    next_page: '',
  })),
  post('courses/check', kStaff, ({ body }) => {
    const problems = courseProblemsOf(body).map(({ path, message }) => ({ path, message }));
    return { ok: problems.length === 0, problems, warnings: [] };
  }),
  get('courses/:id', kAll, ({ lab, params, query }) => revisionAsked(lab.courses, params.id, query, 'course')),
  put('courses/:id', kManagers, ({ lab, params, body, base, who }) => {
    const [problem] = courseProblemsOf(body);
    if (problem)
      throw new Refusal(400, 'invalid_input', `${problem.path}: ${problem.message}`, { field: problem.path });
    return putRevision(lab.courses, params.id, base, body, who.name);
  }),
  get('courses/:id/revisions', [...kStaff, 'RESEARCHER'], ({ lab, params }) =>
    revisionList(lab.courses, params.id, 'course'),
  ),
  get('exercises', kAll, ({ lab }) => ({
    items: [...lab.courses].flatMap(([course_id, r]) =>
      r.at(-1).json.exercises.map((json, position) => ({ course_id, position, json, course_revision: r.length })),
    ),
    next_page: '',
  })),
  get('measures', kAll, () => ({ items: measures, definition_version: 1, next_page: '' })),
  get('assignments', kPeople, ({ lab, query }) =>
    paged(
      lab.assignments.map((a) => ({
        ...a,
        trainee_full_name: fullName(lab, a.trainee),
        group_name: lab.groups.get(a.group_id)?.name ?? '',
      })),
      query,
    ),
  ),
  create('assignments', kStaff, ({ lab, body, who }) => {
    const assignment = {
      id: Math.max(0, ...lab.assignments.map((a) => a.id)) + 1,
      course_id: '',
      exercise_id: '',
      group_id: '',
      trainee: '',
      due_unix_ms: null,
      group_name: '',
      ...body,
      trainee_full_name: fullName(lab, body.trainee),
      by: who.name,
      created_unix_ms: Date.now(),
    };
    lab.assignments.push(assignment);
    return assignment;
  }),
  remove('assignments/:id', kStaff, ({ lab, params }) => {
    lab.assignments = lab.assignments.filter((a) => String(a.id) !== params.id);
    return {};
  }),
  get('results', kPeople, ({ lab, query, who }) => resultsOf(lab, query, who)),
  get('sessions', kPeople, ({ lab, query, who }) =>
    paged(
      lab.sessions
        .filter((s) => isAsked(lab, s, query, who))
        .sort((a, b) => b.started_unix_ms - a.started_unix_ms)
        .map((s) => rowOf(lab, s)),
      query,
      25,
    ),
  ),
  get('unknown-trainees', kPeople, ({ lab, query, who }) =>
    paged(
      lab.sessions.filter((s) => s.unknown_trainee && isAsked(lab, s, {}, who)).map((s) => rowOf(lab, s)),
      query,
      25,
    ),
  ),
  post('sessions/:id/trainee', kManagers, ({ lab, params, body, who }) => {
    const s = sessionOf(lab, params.id, who);
    if (!s.unknown_trainee && !s.given_trainee)
      throw new Refusal(400, 'invalid_input', `session ${s.session_id} is of '${s.trainee}', whom the server knew`);
    if (body.was !== undefined && body.was !== s.trainee)
      throw new Refusal(
        409,
        'conflict',
        `session ${s.session_id} was given to '${s.trainee}' meanwhile, not '${body.was}': look at it, and assign it again if that is wrong`,
      );
    if (body.trainee !== 'guest') found(lab.people, body.trainee, 'person');
    s.given_trainee ??= s.trainee;
    Object.assign(s, { unknown_trainee: false, code_unchecked: false, begin_unsure: false, not_assigned: false });
    if (body.started_unix_ms) s.started_unix_ms = body.started_unix_ms;
    s.trainee = body.trainee;
    return infoOf(lab, s);
  }),
  get('sessions/:id', kPeople, ({ lab, params, who }) => infoOf(lab, sessionOf(lab, params.id, who))),
  get('sessions/:id/attempt', kPeople, ({ lab, params, who }) => {
    const s = sessionOf(lab, params.id, who);
    if (s.unknown_trainee) throw missing(`attempt '${params.id}'`);
    return { ...attemptOf(lab, s), score: null };
  }),
  get('sessions/:id/score', kPeople, ({ lab, params, who }) => scoreReply(lab, sessionOf(lab, params.id, who), true)),
  post('sessions/:id/rescore', kStaff, ({ lab, params, who }) =>
    scoreReply(lab, sessionOf(lab, params.id, who), false),
  ),
  post('sessions/:id/excuse', kStaff, ({ lab, params, body, who }) => {
    const s = sessionOf(lab, params.id, who);
    s.excused = body.excused;
    return attemptOf(lab, s);
  }),
  post('scores/rescore', kAdmin, ({ lab, body }) => ({
    dry_run: !!body.dry_run,
    definition_version: 1,
    rescored: lab.sessions.length,
    left_alone: 0,
    faults: [],
    stopped: false,
  })),
  get('retention', kManagers, ({ lab }) => ({
    policies: lab.retention ?? [],
    database_bytes: 12_400_000,
    free_bytes: 40_960,
    thinned_sessions: 0,
    deleted_sessions: 0,
    last_run_unix_ms: null,
  })),
  put('retention', kManagers, ({ lab, body, who }) => {
    const rest = (lab.retention ?? []).filter((p) => p.exercise_id !== body.policy.exercise_id);
    lab.retention = body.as_default
      ? rest
      : [
          ...rest,
          {
            thin_rate_hz: 0,
            thin_coarser: 0,
            without_backup: false,
            ...body.policy,
            by: who.name,
            changed_unix_ms: Date.now(),
          },
        ];
    return {};
  }),
  post('retention/run', kManagers, ({ body }) => ({
    dry_run: !!body.dry_run,
    stopped: false,
    thinned: 0,
    deleted: 0,
    waiting_for_backup: 0,
    left_alone: 0,
    bytes_before: 0,
    bytes_after: 0,
    steps: [],
    free_bytes: 0,
  })),
  get('studies/:study', ['ADMINISTRATOR', 'RESEARCHER'], ({ lab, params }) => ({
    items: [
      {
        kind: 'study',
        study: params.study,
        format: 1,
        people: [...lab.people.values()].filter((p) => p.consent?.given).length,
        sessions: 0,
        program: 'mock',
      },
    ],
    next_page: '',
  })),
  get('sessions/:id/events', kPeople, ({ lab, params, who }) => {
    const s = sessionOf(lab, params.id, who),
      t = s.gesture.inserted_s,
      at = place(s, 'target');
    return {
      items: [
        {
          kind: 'ASPIRATION',
          begin_tick: Math.round((t + 0.5) * 1000),
          end_tick: Math.round((t + 1) * 1000),
          hazards: [],
          begin_s: t + 0.5,
          end_s: t + 1,
          plunger_from: 0.5,
          plunger_to: 0.4,
          in_tissue_share: 1,
          in_target_share: 1,
          begin: at,
          end: at,
        },
        {
          kind: 'INJECTION',
          begin_tick: Math.round((t + 1) * 1000),
          end_tick: Math.round((t + 2.5) * 1000),
          hazards: [],
          begin_s: t + 1,
          end_s: t + 2.5,
          plunger_from: 0.4,
          plunger_to: 0.9,
          in_tissue_share: 1,
          in_target_share: 0.8,
          begin: at,
          end: at,
        },
      ],
      stored: true,
      next_page: '',
    };
  }),
  get('sessions/:id/samples', kPeople, ({ lab, params, query, who }) =>
    samplesOf(sessionOf(lab, params.id, who), query),
  ),
  get('sessions/:id/section', kPeople, ({ lab, params, who }) => {
    const profile = profileOf(lab, sessionOf(lab, params.id, who));
    if (!profile.volume) throw new Refusal(400, 'invalid_input', 'volume: is missing: only a body can be cut');
    return sectionOf(profile);
  }),
  get('sessions/:id/annotations', kPeople, ({ lab, params, who }) => ({
    items: lab.annotations.get(sessionOf(lab, params.id, who).session_id) ?? [],
    next_page: '',
  })),
  create('sessions/:id/annotations', ['INSTRUCTOR', 'ADMINISTRATOR'], ({ lab, params, body, who }) => {
    const all = lab.annotations.get(params.id) ?? [];
    const annotation = {
      id: all.length + 1,
      author: who.name,
      created_unix_ms: Date.now(),
      session_id: params.id,
      tick: Math.round(body.t_s * 1000),
      ...body,
    };
    lab.annotations.set(params.id, [...all, annotation]);
    return annotation;
  }),
  get(
    'exercises/:id/reference',
    kPeople,
    ({ lab, params }) =>
      lab.references.get(params.id) ?? {
        exercise_id: params.id,
        revision: 0,
        session_ids: [],
        bands: [],
        changed_by: '',
        changed_unix_ms: null,
        definition_version: 1,
        pending: [],
      },
  ),
  put('exercises/:id/reference', kStaff, ({ lab, params, body, who }) => {
    const bands = bandOf(lab.sessions.filter((s) => body.session_ids.includes(s.session_id)));
    lab.references.set(params.id, {
      exercise_id: params.id,
      revision: (lab.references.get(params.id)?.revision ?? 0) + 1,
      session_ids: body.session_ids,
      bands,
      changed_by: who.name,
      changed_unix_ms: Date.now(),
      definition_version: 1,
      pending: [],
    });
    return lab.references.get(params.id);
  }),
  get('stations', kStaff, () => ({
    items: [1, 2, 3, 4].map((i) => ({ name: `bench-${i}`, revoked: false, created_unix_ms: kNow_ms, online: i < 4 })),
    live_trouble: '',
    next_page: '',
  })),
  get('audit', kAdmin, ({ lab, query }) =>
    paged(
      lab.audit
        .filter((e) => (!query.who || e.who === query.who) && (!query.action || e.action === query.action))
        .reverse(),
      query,
    ),
  ),
  post('backup', kAdmin, ({ body }) => ({
    path: body?.path || '/var/backups/needlelab/2026-11-20T09-00-00Z.db',
    bytes: 12_400_000,
    chunks_verified: 914,
    undecodable_chunks: 0,
    encrypted: false,
    removed: [],
    disk: body?.path ? 'ANOTHER_DISK' : 'SAME_DISK',
    safe: Boolean(body?.path || body?.counts_as_safe),
  })),
  post('check', kAdmin, ({ lab }) => ({ ok: true, sessions: lab.sessions.length, chunks: 914, faults: [] })),
];

/** CSV with units in the header. */
export function csvOf(lab, parts, query) {
  if (parts[0] === 'sessions') {
    const session = lab.sessions.find((s) => s.session_id === parts[1]);
    if (!session) throw missing('session');
    const names = Object.keys(session.gesture.columns);
    return [names, ...session.gesture.columns.t_s.map((_, i) => names.map((n) => session.gesture.columns[n][i]))]
      .map((r) => r.join(',') + '\r\n')
      .join('');
  }
  const results = resultsOf(
    lab,
    { course: parts[0] === 'courses' ? parts[1] : query.course || [...lab.courses.keys()][0], group: query.group },
    { role: 'ADMINISTRATOR' },
  );
  return (
    [
      'trainee,exercise_id,attempts,passed',
      ...results.rows.flatMap((r) =>
        r.cells.map((c) => `${r.trainee},${c.exercise_id},${c.attempts},${c.passed ?? ''}`),
      ),
    ].join('\r\n') + '\r\n'
  );
}

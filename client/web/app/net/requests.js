// A function for each request that pages make. Lists are arrays even if the reply omits them.
import { get, getAll, patch, post, put, remove } from './api.js';
import { roleName } from '../lib/roles.js';

/** Number of choices that a search offers. */
const kOffered = 20;

/** The first matches, to choose from (ui/search_field.js). */
async function offered(parts, text, query, option, signal) {
  const reply = await get(parts, { signal, query: { ...query, search: text.trim(), limit: kOffered } });
  return { options: reply.items.map(option), more: !!reply.next_page };
}

const person = (p) => ({ ...p, role: roleName(p.role), full_name: p.full_name ?? '', groups: p.groups ?? [] });
const personOption = (p) => ({
  key: p.name,
  text: (p.full_name ? `${p.full_name} (${p.name})` : p.name) + (p.disabled ? ', disabled' : ''),
});
const group = (g) => ({ ...g, members: g.members ?? [] });
const groupOption = (g) => ({ key: g.id, text: g.name === g.id ? g.id : `${g.name} (${g.id})` });

export const people = {
  /** People whose name, full name or group contains the text. @param {{role?: string}} query */
  find: (text, query, signal) => offered(['people'], text, query, personOption, signal),
  /** `query`: search, role, page. @returns {Promise<{items: any[], next_page: string, total?: number}>} `total` with the first page */
  page: async (query, signal) => {
    const reply = await get(['people'], { signal, query });
    return { ...reply, items: reply.items.map(person) };
  },
  one: async (name, signal) => person(await get(['people', name], { signal })),
  add: (body) => post(['people'], { ...body, role: body.role.toUpperCase().replaceAll('-', '_') }),
  change: async (p, changes) => {
    const body = changes.role ? { ...changes, role: changes.role.toUpperCase().replaceAll('-', '_') } : changes;
    return person(await patch(['people', p.name], body, { base_revision: p.revision }));
  },
  /** To change your own password, give the old one, too. */
  setPassword: (name, password, old_password) =>
    post(['people', name, 'password'], { password, ...(old_password && { old_password }) }),
  /** `change`: { make: true }, or { code }; an empty code removes it. @returns {Promise<{name: string, code: string}>} the made one */
  setCode: (name, change) => post(['people', name, 'code'], change),
  importCsv: (csv, lines_above, dry_run) => post(['people', 'import'], { csv, lines_above, dry_run }),
  /** All texts that name the person or contain the words. @returns {Promise<{where: string, about: string, text: string, link: string}[]>} */
  mentions: (name, text) => getAll(['people', name, 'mentions'], { text }, Infinity),
  redact: (name, text, where) => post(['people', name, 'mentions'], { text, where }),
  erase: (name, reason, with_waiting_sessions) =>
    remove(['people', name, 'data'], { body: { confirm: name, reason, with_waiting_sessions } }),
  /** All stored data of one person, from all pages. */
  everything: (name) => getAll(['people', name, 'export'], {}, Infinity),
  /** The exercises that the person attempted, last tried first. @returns {Promise<{exercise_id: string, attempts: number}[]>} */
  tried: async (name, signal) => (await get(['people', name, 'exercises'], { signal })).items,
  /**
   * Attempts at an exercise, newest first; the first page also has each measure's course over the attempts, null if
   * there are too few.
   */
  attempts: (name, exercise, page, signal) =>
    get(['people', name, 'progress'], { signal, query: { exercise, newest_first: 'yes', page } }),
};

/** Settings of the whole lab. */
export const lab = {
  settings: (signal) => get(['lab', 'settings'], { signal }),
  change: (changes) => patch(['lab', 'settings'], changes),
};

export const groups = {
  /** Groups whose id or name contains the text. */
  find: (text, signal) => offered(['groups'], text, { brief: 'yes' }, groupOption, signal),
  /** With the number of members instead of their names. */
  page: (query, signal) => get(['groups'], { signal, query: { ...query, brief: 'yes', limit: 100 } }),
  one: async (id, signal) => group(await get(['groups', id], { signal })),
  add: (body) => post(['groups'], body),
  put: (g) => put(['groups', g.id], { id: g.id, name: g.name, members: g.members }, { base_revision: g.revision }),
  remove: (g) => remove(['groups', g.id], { base_revision: g.revision }),
};

/** Profiles and courses: documents with revisions. `kind`: 'profiles' or 'courses'. */
export const documents = (kind) => ({
  all: (signal) => getAll([kind], { signal }),
  /** @returns {Promise<{id: string, revision: number, json: any, created_unix_ms: number, author: string}>} */
  one: (id, revision, signal) => get([kind, id], { signal, query: { revision } }),
  revisions: (id, signal) => getAll([kind, id, 'revisions'], { signal }),
  /** @throws {ApiError} 'conflict' with current_revision */
  put: (id, json, base_revision) => put([kind, id], json, { base_revision }),
});

/** The problems of a profile or course; warnings name their field before a colon. */
async function check(path, json, signal) {
  const reply = await post(path, json, { signal });
  const warnings = (reply.warnings ?? []).map((text) => {
    const [, at, message] = /^([A-Za-z_]\w*(?:[.[][\w.[\]]*)?): (.*)$/s.exec(text) ?? [null, '', text];
    return { path: at, message, severity: 'WARNING' };
  });
  return [...(reply.problems ?? []).map((p) => ({ ...p, severity: 'ERROR' })), ...warnings];
}
export const checkProfile = (json, signal) => check(['profiles', 'check'], json, signal);
export const checkCourse = (json, signal) => check(['courses', 'check'], json, signal);

/** Force over depth as the engine renders it; the profile's name does not matter. `query`: points, to_depth_m. */
export const previewProfile = (json, signal, query = {}) =>
  post(['profiles', 'preview'], { ...json, id: json.id || 'new', name: json.name || 'new' }, { signal, query });

export const measures = (signal) => getAll(['measures'], { signal });
export const exercises = async (signal) =>
  (await getAll(['exercises'], { signal })).map(({ json, ...row }) => ({ ...json, ...row }));

export const assignments = {
  page: (page, signal) => get(['assignments'], { signal, query: { limit: 100, page } }),
  of: (trainee, signal) => getAll(['assignments'], { signal, query: { trainee } }),
  add: (body) => post(['assignments'], body),
  remove: (id) => remove(['assignments', String(id)]),
};

/**
 * A page of trainees; the first one also has their number and how many of them passed each exercise.
 * @returns {Promise<{exercises: {id: string, name: string}[], items: any[], next_page: string, trainees?: number, passed: number[]}>}
 */
export async function results({ course, group, page }, signal) {
  const reply = await get(['results'], { signal, query: { course, group, page } });
  return {
    exercises: (reply.exercise_ids ?? []).map((id, i) => ({ id, name: reply.exercise_names?.[i] ?? id })),
    items: (reply.rows ?? []).map((row) => ({
      ...row,
      cells: (row.cells ?? []).map((c) => ({ ...c, locked_by: c.locked_by ?? [] })),
    })),
    next_page: reply.next_page ?? '',
    trainees: reply.trainees,
    passed: reply.trainees_passed ?? [],
  };
}

export const sessions = {
  page: (query, signal) => get(['sessions'], { signal, query }),
  /** Sessions whose trainee was not known when they came, or that came without a code; they wait to be assigned. */
  unknown: (query, signal) => get(['unknown-trainees'], { signal, query }),
  /** `was`: the trainee that the page shows; refused if the session was given to another one meanwhile. */
  /** `started_unix_ms`: when it began, if the station's clock was wrong. */
  assign: (id, trainee, reason, was, started_unix_ms) =>
    post(['sessions', id, 'trainee'], { trainee, reason, was, ...(started_unix_ms && { started_unix_ms }) }),
  one: (id, signal) => get(['sessions', id], { signal }),
  score: (id, signal) => get(['sessions', id, 'score'], { signal }),
  /** The session as an attempt; null: it is not one. */
  attempt: async (id, signal) => {
    try {
      return await get(['sessions', id, 'attempt'], { signal });
    } catch (error) {
      if (error.kind === 'not_found') return null;
      throw error;
    }
  },
  rescore: (id) => post(['sessions', id, 'rescore'], {}),
  excuse: (id, excused, reason) => post(['sessions', id, 'excuse'], { excused, reason }),
  events: (id, signal) => getAll(['sessions', id, 'events'], { signal }),
  samples: (id, query, signal) => get(['sessions', id, 'samples'], { signal, query }),
  /** The body of the session's profile, cut where the needle first came in. */
  section: (id, signal) => get(['sessions', id, 'section'], { signal }),
  /** Remarks have a moment: `t_s` since the first sample. */
  annotations: (id, signal) => getAll(['sessions', id, 'annotations'], { signal }),
  annotate: (id, t_s, text) => post(['sessions', id, 'annotations'], { t_s, text }),
};

export const references = {
  one: (exercise, signal) => get(['exercises', exercise, 'reference'], { signal }),
  put: (exercise, session_ids, revision) =>
    put(['exercises', exercise, 'reference'], { session_ids }, { base_revision: revision }),
};

/**
 * What needs attention, for staff: numbers, and the rows of one list.
 * @param {'due'|'behind'|'struggling'|undefined} list
 */
export const today = (list, page, signal) => get(['today'], { signal, query: { list, page, limit: 100 } });

export const retention = {
  all: (signal) => get(['retention'], { signal }),
  put: (policy) => put(['retention'], { policy }),
  /** Removes the exercise's own policy, so that the policy of all others applies. */
  drop: (exercise_id) => put(['retention'], { policy: { exercise_id }, as_default: true }),
  run: (dry_run) => post(['retention', 'run'], { dry_run }),
};

/** Records of a study, page by page; calls `said` with the number so far. */
export async function studyRecords(study, { exercise, remarks }, said) {
  const records = [];
  for (let page = ''; ;) {
    const reply = await get(['studies', study], { query: { exercise, remarks: remarks ? 'yes' : '', page } });
    records.push(...reply.items);
    said(records.length);
    page = reply.next_page ?? '';
    if (!page) return records;
  }
}

export const upkeep = {
  backup: (path, counts_as_safe) => post(['backup'], { ...(path && { path }), counts_as_safe }),
  check: () => post(['check'], {}),
  /** The free space on the disk of the server's database; does not prolong the log-in. */
  room: async (signal) => (await get(['session'], { signal })).disk_room,
  /** What an acknowledgement survives, and whether changes are stored; does not prolong the log-in. */
  store: async (signal) => (await get(['session'], { signal })).store,
  rescore: (exercise_id, dry_run) => post(['scores', 'rescore'], { exercise_id, dry_run }),
  audit: (query, signal) => get(['audit'], { signal, query }),
};

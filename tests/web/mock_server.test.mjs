// The mock server is a double of server/web: every route of the API that the console asks for, its replies as
// `needlelab-server --openapi` describes them. (tests/unit/server/web compares the replies of the real port with the
// same description.)
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { after, before, test } from 'node:test';
import { kExportFormats } from '../../client/web/app/lib/export_formats.js';
import { replySchema, schemaFaults } from './support/json_schema.mjs';
import { startMock } from './mock_server.mjs';

const folder = process.env.NEEDLELAB_BIN ?? new URL('../../build/dev/bin', import.meta.url).pathname;
const api = JSON.parse(
  execFileSync(`${folder}/needlelab-server`, ['--openapi'], { encoding: 'utf8', maxBuffer: 1 << 24 }),
);
const kPassword = 'correct horse';
// addresses that no page of the console asks for
const kUnused = ['GET /openapi.json', 'GET /people/{name}/consents', 'GET /live'];

let mock, lab;
const who = {};
const asked = new Set(),
  faults = [];

async function ask(name, method, pattern, { path = pattern, body, base } = {}) {
  const headers = { Cookie: who[name]?.cookie ?? '', 'X-CSRF-Token': who[name]?.csrf_token ?? '' };
  if (body !== undefined) headers['Content-Type'] = 'application/json';
  if (base !== undefined) headers['If-Match'] = `"${base}"`;
  const reply = await fetch(`http://127.0.0.1:${mock.port}/api/v1${path}`, {
    method,
    headers,
    body: body === undefined ? undefined : JSON.stringify(body),
  });
  const text = await reply.text(),
    about = `${name} ${method} ${path}: ${reply.status}`;
  const type = reply.headers.get('content-type');
  const described = api.paths[pattern]?.[method.toLowerCase()];
  assert.ok(described, `${method} ${pattern} is no route of the server`);
  if (reply.status < 300) {
    asked.add(`${method} ${pattern}`);
    assert.ok(described.responses[reply.status], `${about} is not described: ${Object.keys(described.responses)}`);
  }
  const schema = replySchema(api, method, pattern, reply.status);
  if (!schema) {
    const [described_type] = Object.keys(described.responses[reply.status].content);
    assert.equal(type.split(';')[0], described_type, about);
    return { status: reply.status, body: text };
  }
  assert.equal(type, 'application/json', about);
  const json = JSON.parse(text);
  faults.push(...schemaFaults(schema, json, api).map((fault) => `${about}: ${fault}`));
  return { status: reply.status, body: json, cookie: reply.headers.get('set-cookie') };
}

async function logIn(name) {
  const reply = await ask(name, 'POST', '/session', { body: { name, password: kPassword } });
  who[name] = { cookie: reply.cookie.split(';')[0], csrf_token: reply.body.csrf_token };
}

before(async () => {
  mock = await startMock(0);
  lab = mock.lab;
  for (const name of ['mara', 'ines', 'root', 'rhea', 'anna.bauer']) await logIn(name);
});
after(() => mock.close());

test('every page of every list, and what is below it', async () => {
  const session = lab.sessions[0],
    id = session.session_id;
  const lists = [
    '/people',
    '/groups',
    '/profiles',
    '/courses',
    '/exercises',
    '/measures',
    '/assignments',
    '/sessions',
    '/unknown-trainees',
    '/today',
    '/stations',
    '/session',
    '/lab/settings',
  ];
  for (const pattern of lists) assert.equal((await ask('ines', 'GET', pattern)).status, 200, pattern);
  const below = {
    '/people/{name}': '/people/anna.bauer',
    '/people/{name}/progress': '/people/anna.bauer/progress',
    '/people/{name}/exercises': '/people/anna.bauer/exercises',
    '/groups/{id}': '/groups/autumn-a',
    '/profiles/{id}': '/profiles/shoulder-adult',
    '/profiles/{id}/revisions': '/profiles/shoulder-adult/revisions',
    '/courses/{id}': `/courses/${[...lab.courses.keys()][0]}`,
    '/courses/{id}/revisions': `/courses/${[...lab.courses.keys()][0]}/revisions`,
    '/results': `/results?course=${[...lab.courses.keys()][0]}`,
    '/exercises/{id}/reference': `/exercises/${session.exercise_id}/reference`,
  };
  for (const { suffix } of kExportFormats.scores) below[`/scores${suffix}`] = `/scores${suffix}`;
  for (const { suffix } of kExportFormats.results)
    below[`/courses/{id}/results${suffix}`] =
      `/courses/${[...lab.courses.keys()][0]}/results${suffix}?separator=semicolon`;
  for (const [pattern, path] of Object.entries(below))
    assert.equal((await ask('ines', 'GET', pattern, { path })).status, 200, path);
  const downloads = kExportFormats.samples.map(({ suffix }) => `/samples${suffix}`);
  for (const part of ['', '/attempt', '/score', '/events', '/samples', ...downloads, '/annotations']) {
    assert.equal(
      (await ask('ines', 'GET', `/sessions/{id}${part}`, { path: `/sessions/${id}${part}` })).status,
      200,
      part,
    );
  }
  for (const [of, status] of [
    [lab.sessions.at(-1).session_id, 200],
    [id, 400],
  ])
    assert.equal(
      (await ask('ines', 'GET', '/sessions/{id}/section', { path: `/sessions/${of}/section` })).status,
      status,
    );
  const first = await ask('ines', 'GET', '/groups', { path: '/groups?brief=yes&limit=1' });
  assert.deepEqual(first.body.items[0].members, []);
  assert.ok(first.body.items[0].member_count > 0);
  assert.equal((await ask('ines', 'GET', '/groups', { path: '/groups?search=none+has+this' })).body.items.length, 0);
  const tried = (await ask('ines', 'GET', '/people/{name}/exercises', { path: '/people/anna.bauer/exercises' })).body;
  for (const { exercise_id, attempts, newest_unix_ms } of tried.items) {
    const path = `/people/anna.bauer/progress?exercise=${exercise_id}&newest_first=yes`;
    const { items } = (await ask('ines', 'GET', '/people/{name}/progress', { path })).body;
    assert.deepEqual([items.length, items[0].started_unix_ms], [attempts, newest_unix_ms]);
  }
  assert.equal((await ask('mara', 'GET', '/people/{name}/export', { path: '/people/anna.bauer/export' })).status, 200);
  assert.equal((await ask('root', 'GET', '/audit')).status, 200);
  assert.equal(
    (await ask('anna.bauer', 'GET', '/results', { path: `/results?course=${[...lab.courses.keys()][0]}` })).body.rows
      .length,
    1,
  );
});

test('changes, and what comes of those that are too late', async () => {
  const id = lab.sessions[0].session_id,
    exercise = lab.sessions[0].exercise_id;
  const one = async (name, method, pattern, more, status = 200) => {
    const reply = await ask(name, method, pattern, more);
    assert.equal(reply.status, status, `${method} ${more.path ?? pattern}: ${JSON.stringify(reply.body)}`);
    return reply.body;
  };
  await one('mara', 'POST', '/people', { body: { name: 'new.one', full_name: 'New One', role: 'TRAINEE' } }, 201);
  await one('mara', 'POST', '/people', { body: { name: 'new.one', role: 'TRAINEE' } }, 409);
  await one('mara', 'PATCH', '/people/{name}', { path: '/people/new.one', body: { full_name: 'Newer' }, base: 1 });
  assert.equal(
    (await one('mara', 'PATCH', '/people/{name}', { path: '/people/new.one', body: { full_name: 'x' }, base: 1 }, 409))
      .error.current_revision,
    2,
  );
  await one('mara', 'PATCH', '/people/{name}', { path: '/people/new.one', body: { full_name: 'x' } }, 400);
  await one('mara', 'PATCH', '/people/{name}', { path: '/people/new.one', body: { consent: true } });
  await one('root', 'POST', '/people/{name}/password', {
    path: '/people/new.one/password',
    body: { password: 'another horse' },
  });
  const own = (body) => ({ path: '/people/root/password', body: { password: 'another horse', ...body } });
  await one('root', 'POST', '/people/{name}/password', own({}), 400);
  await one('root', 'POST', '/people/{name}/password', own({ old_password: 'a wrong horse' }), 403);
  const code = (body) => ({ path: '/people/new.one/code', body });
  assert.match((await one('mara', 'POST', '/people/{name}/code', code({ make: true }))).code, /^\d{6}$/);
  assert.equal((await one('mara', 'GET', '/people/{name}', { path: '/people/new.one' })).has_code, true);
  assert.equal((await one('mara', 'POST', '/people/{name}/code', code({ code: '123' }), 400)).error.field, 'code');
  await one('ines', 'POST', '/people/{name}/code', code({ make: true }), 403);
  assert.equal((await one('mara', 'POST', '/people/{name}/code', code({ code: '' }))).code, '');
  assert.equal((await one('mara', 'GET', '/people/{name}', { path: '/people/new.one' })).has_code, false);
  await one('mara', 'PATCH', '/lab/settings', { body: { codes_required: true } }, 403);
  assert.deepEqual(await one('root', 'PATCH', '/lab/settings', { body: { codes_required: true } }), {
    codes_required: true,
    keep_recordings_of_erased: false,
  });
  assert.equal((await one('ines', 'GET', '/lab/settings', {})).codes_required, true);
  await one('mara', 'POST', '/people/import', { body: { csv: 'name,role\nzoe,trainee\n', dry_run: true } });
  // a code goes to who has none, and stays where there is one
  for (const [code, what] of [
    ['1234', 'CHANGE'],
    ['5678', 'NOTHING'],
  ]) {
    const body = { csv: `name,code\nanna.bauer,${code}\n` };
    assert.equal((await one('mara', 'POST', '/people/import', { body })).rows[0].what, what);
    assert.equal(lab.people.get('anna.bauer').code, '1234');
  }
  await one('mara', 'POST', '/groups', { body: { id: 'g', name: 'G', members: ['new.one'] } }, 201);
  await one('mara', 'POST', '/groups', { body: { id: 'g', name: 'G', members: [] } }, 409);
  await one('mara', 'PUT', '/groups/{id}', { path: '/groups/g', body: { id: 'g', name: 'G2', members: [] }, base: 1 });
  await one(
    'mara',
    'PUT',
    '/groups/{id}',
    { path: '/groups/g', body: { id: 'g', name: 'G2', members: [] }, base: 1 },
    409,
  );
  await one('mara', 'DELETE', '/groups/{id}', { path: '/groups/g', base: 1 }, 409);
  await one('mara', 'DELETE', '/groups/{id}', { path: '/groups/g', base: 2 });
  await one('mara', 'GET', '/groups/{id}', { path: '/groups/g' }, 404);
  for (const kind of ['profiles', 'courses']) {
    const document = kind === 'profiles' ? 'knee-adult' : [...lab.courses.keys()][0];
    const { json, revision } = await one('mara', 'GET', `/${kind}/{id}`, { path: `/${kind}/${document}` });
    await one('mara', 'POST', `/${kind}/check`, { body: json });
    await one('mara', 'PUT', `/${kind}/{id}`, { path: `/${kind}/${document}`, body: json, base: revision });
    await one('mara', 'PUT', `/${kind}/{id}`, { path: `/${kind}/${document}`, body: json, base: revision }, 409);
    await one('mara', 'PUT', `/${kind}/{id}`, { path: `/${kind}/${document}`, body: json }, 400);
    if (kind === 'profiles') await one('ines', 'POST', '/profiles/preview', { body: json });
  }
  const given = await one(
    'ines',
    'POST',
    '/assignments',
    { body: { exercise_id: exercise, trainee: 'anna.bauer', due_unix_ms: 1.9e12 } },
    201,
  );
  await one('ines', 'DELETE', '/assignments/{id}', { path: `/assignments/${given.id}` });
  await one(
    'ines',
    'POST',
    '/sessions/{id}/annotations',
    { path: `/sessions/${id}/annotations`, body: { t_s: 1.5, text: 'well' } },
    201,
  );
  await one('ines', 'POST', '/sessions/{id}/rescore', { path: `/sessions/${id}/rescore`, body: {} });
  await one('ines', 'PUT', '/exercises/{id}/reference', {
    path: `/exercises/${exercise}/reference`,
    body: { session_ids: [id] },
    base: 0,
  });
  await one('ines', 'GET', '/sessions/{id}/score', { path: `/sessions/${id}/score` });
  await one('ines', 'POST', '/sessions/{id}/excuse', {
    path: `/sessions/${id}/excuse`,
    body: { excused: true, reason: 'the station failed' },
  });
  const assign = (trainee, was) => ({
    path: `/sessions/${id}/trainee`,
    body: { trainee, reason: 'a typing error', was },
  });
  await one('mara', 'POST', '/sessions/{id}/trainee', assign('ben.osei'), 400);
  Object.assign(lab.sessions[0], { trainee: 'ana', unknown_trainee: true });
  assert.equal((await one('mara', 'GET', '/unknown-trainees', {})).items.length, 1);
  await one('ines', 'POST', '/sessions/{id}/trainee', assign('anna.bauer'), 403);
  await one('mara', 'POST', '/sessions/{id}/trainee', assign('nobody'), 404);
  assert.equal((await one('mara', 'POST', '/sessions/{id}/trainee', assign('anna.bauer', 'ana'))).given_trainee, 'ana');
  // another manager still sees it as ana's
  const late = await one('mara', 'POST', '/sessions/{id}/trainee', assign('ben.osei', 'ana'), 409);
  assert.match(late.error.message, /was given to 'anna\.bauer' meanwhile, not 'ana'/);
  await one('mara', 'POST', '/sessions/{id}/trainee', assign('ben.osei', 'anna.bauer'));
  await one('mara', 'POST', '/sessions/{id}/trainee', assign('anna.bauer'));
  await one('mara', 'PUT', '/retention', { body: { policy: { exercise_id: '', delete_after_days: 3650 } } });
  await one('mara', 'GET', '/retention', {});
  await one('mara', 'POST', '/retention/run', { body: { dry_run: true } });
  await one('root', 'POST', '/scores/rescore', { body: { dry_run: true } });
  await one('rhea', 'GET', '/studies/{study}', { path: '/studies/s1' });
  assert.equal((await one('root', 'POST', '/backup', { body: {} })).safe, false);
  assert.equal((await one('root', 'POST', '/backup', { body: { counts_as_safe: true } })).safe, true);
  await one('root', 'POST', '/check', { body: {} });
  Object.assign(lab.sessions[1], { trainee: 'anna.bauer', unknown_trainee: true, code_unchecked: true });
  const [waits] = (await one('mara', 'GET', '/unknown-trainees', {})).items;
  assert.equal(waits.code_unchecked, true);
  const confirmed = await one('mara', 'POST', '/sessions/{id}/trainee', {
    path: `/sessions/${waits.description.session_id}/trainee`,
    body: { trainee: 'anna.bauer', was: 'anna.bauer' },
  });
  assert.deepEqual([confirmed.unknown_trainee, confirmed.code_unchecked], [undefined, false]);
  const mentions = await one('root', 'GET', '/people/{name}/mentions', {
    path: '/people/new.one/mentions?text=group+A',
  });
  assert.deepEqual(
    mentions.items.map((one) => one.where),
    ['group autumn-a'],
  );
  await one('root', 'POST', '/people/{name}/mentions', {
    path: '/people/new.one/mentions',
    body: { text: 'group A', where: 'group autumn-a' },
  });
  await one('root', 'DELETE', '/people/{name}/data', { path: '/people/new.one/data', body: { confirm: 'new.one' } });
});

test('what is refused', async () => {
  assert.equal((await ask('nobody', 'GET', '/people')).status, 401);
  assert.equal((await ask('rhea', 'GET', '/people')).status, 403);
  const token = who.mara.csrf_token;
  who.mara.csrf_token = 'wrong';
  assert.equal((await ask('mara', 'POST', '/people', { body: { name: 'x', role: 'TRAINEE' } })).status, 403);
  who.mara.csrf_token = token;
  assert.equal((await ask('ines', 'GET', '/sessions/{id}', { path: '/sessions/none' })).status, 404);
  assert.equal((await ask('mara', 'DELETE', '/session')).status, 200);
});

test('all replies are as they are described, and no address was left out', () => {
  assert.deepEqual(faults, []);
  const routes = Object.entries(api.paths).flatMap(([pattern, methods]) =>
    Object.keys(methods).map((method) => `${method.toUpperCase()} ${pattern}`),
  );
  assert.deepEqual(
    routes.filter((route) => !asked.has(route) && !kUnused.includes(route)),
    [],
  );
});

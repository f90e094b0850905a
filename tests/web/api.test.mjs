// The console's requests against the mock server: log-in that expires, CSRF, revisions, a server that goes away.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { get, getAll, setCsrfToken } from '../../client/web/app/net/api.js';
import { connection } from '../../client/web/app/net/connection.js';
import { documents, groups, people } from '../../client/web/app/net/requests.js';
import { giveUp, logIn, logOut, session } from '../../client/web/app/net/session.js';
import { fetchAsBrowser } from './support/browser_fetch.mjs';
import { startMock } from './mock_server.mjs';

const kPassword = 'correct horse';
let mock;
const browser = fetchAsBrowser(() => mock.port);

before(async () => {
  mock = await startMock(0);
});
after(() => mock.close());

test('a wrong password is told apart from a locked log-in', async () => {
  for (let i = 0; i < 5; i++) await assert.rejects(logIn('ines', 'wrong'), { kind: 'expired' });
  await assert.rejects(logIn('ines', kPassword), (error) => error.kind === 'busy' && error.retry_after_s > 0);
});

test('after the log-in the role is known and changes carry the CSRF token', async () => {
  await logIn('mara', kPassword);
  assert.equal(session.get().person.role, 'curriculum-manager');
  browser.sent = [];
  await groups.add({ id: 'g1', name: 'G', members: [] });
  assert.ok(browser.sent.at(-1).headers['X-CSRF-Token']);
  await groups.remove({ id: 'g1', revision: 1 });
});

test('lists are read to their end', async () => {
  const all = await getAll(['people']);
  assert.equal(all.length, mock.lab.people.size);
  assert.ok(browser.sent.filter((s) => /^\/api\/v1\/people(\?|$)/.test(s.path)).length >= 2, 'in several pages');
});

test('a change from an old revision is a conflict that names the newest', async () => {
  const profiles = documents('profiles'),
    { json, revision } = await profiles.one('knee-adult');
  await profiles.put('knee-adult', { ...json, name: 'one' }, revision);
  await assert.rejects(
    profiles.put('knee-adult', { ...json, name: 'two' }, revision),
    (error) => error.kind === 'conflict' && error.current_revision === revision + 1,
  );
  assert.equal((await profiles.one('knee-adult')).json.name, 'one');
  assert.equal((await profiles.one('knee-adult', revision)).json.name, json.name, 'the old one is still there');
});

test('bad input names its field', async () => {
  await assert.rejects(
    people.add({ name: 'No Good', role: 'trainee' }),
    (error) => error.kind === 'invalid' && error.field === 'name',
  );
});

test('what the role may not do is denied', async () => {
  await assert.rejects(get(['audit']), { kind: 'denied' });
});

test('a request of an expired log-in waits for the new one and is then sent again', async () => {
  mock.lab.logins.clear();
  const waiting = people.one('anna.bauer');
  await new Promise((resolve) => {
    const stop = session.follow(({ state }) => state === 'expired' && (stop(), resolve()));
  });
  await logIn('mara', kPassword);
  assert.equal((await waiting).name, 'anna.bauer');
  assert.equal(session.get().state, 'in');
});

test('when the log-in is not renewed the request fails, and so it does when somebody else logs in', async () => {
  for (const end of [giveUp, () => logIn('root', kPassword)]) {
    await logIn('mara', kPassword);
    mock.lab.logins.clear();
    const waiting = assert.rejects(people.one('anna.bauer'), { kind: 'expired' });
    await new Promise((resolve) => {
      const stop = session.follow(({ state }) => state === 'expired' && (stop(), resolve()));
    });
    await end();
    await waiting;
  }
  await logOut();
  assert.equal(session.get().state, 'out');
});

test('without the server the request says so, and the connection comes back by itself', async () => {
  await logIn('mara', kPassword);
  const { port, lab } = mock;
  await mock.close();
  await assert.rejects(get(['groups']), { kind: 'away' });
  assert.equal(connection.get().away, true);
  mock = await startMock(port);
  mock.lab.logins = lab.logins;
  await new Promise((resolve) => {
    const stop = connection.follow(({ away }) => !away && (stop(), resolve()));
  });
  setCsrfToken('');
  assert.ok((await get(['groups'])).items.length > 0);
});

test('another page of this browser logs in again: the next change takes its token over and goes through', async () => {
  await logIn('mara', kPassword);
  setCsrfToken('of the log-in before');
  browser.sent = [];
  await groups.add({ id: 'g2', name: 'G', members: [] });
  assert.deepEqual(
    browser.sent.map((s) => s.method),
    ['POST', 'GET', 'POST'],
  );
  await groups.remove({ id: 'g2', revision: 1 });
});

test('another page of this browser logs in as somebody else: nothing is sent in their name', async () => {
  await logIn('mara', kPassword);
  await fetch('/api/v1/session', {
    method: 'POST',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify({ name: 'root', password: kPassword }),
  });
  browser.sent = [];
  await assert.rejects(
    groups.add({ id: 'g3', name: 'G', members: [] }),
    (error) => error.kind === 'expired' && /root/.test(error.message),
  );
  assert.deepEqual(
    browser.sent.map((s) => s.method),
    ['POST', 'GET'],
  );
  assert.equal(session.get().state, 'out');
  assert.equal(mock.lab.groups.has('g3'), false);
});

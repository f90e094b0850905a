// The room on the server's disk, from the server's answer to the words on the page.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import { kRoomLevels } from '../../client/web/app/lib/database.js';
import { upkeep } from '../../client/web/app/net/requests.js';
import { logIn } from '../../client/web/app/net/session.js';
import { RoomText } from '../../client/web/app/pages/upkeep.js';
import { fetchAsBrowser } from './support/browser_fetch.mjs';
import { startMock } from './mock_server.mjs';
import { textOf } from './support/page_text.mjs';

let mock;
fetchAsBrowser(() => mock.port);

before(async () => {
  mock = await startMock(0);
});
after(() => mock.close());

const shown = async (room) => {
  mock.lab.disk_room = room;
  return textOf(RoomText({ room: await upkeep.room() }));
};

test('the levels are those that the server names, and read only', () => {
  const source = readFileSync(new URL('../../server/live/limits/disk_room.cpp', import.meta.url), 'utf8');
  const names = [...source.matchAll(/case RoomLevel::\w+:\s+return "(\w+)";/g)].map(([, name]) => name);
  assert.deepEqual(Object.keys(kRoomLevels), [...names, 'read_only']);
});

test('an administrator reads the room, what is refused and what to do next', async () => {
  await logIn('root', 'correct horse');
  const plenty = await shown({ level: 'plenty', left_bytes: 250e9 });
  assert.match(plenty, /✓\s*enough room.*250\sGB.*Nothing to do/s);
  const sessions = await shown({ level: 'no_new_sessions', left_bytes: 1e9 });
  assert.match(sessions, /!\s*new sessions refused.*1\sGB.*stored to their end.*Make room.*retention/s);
  const chunks = await shown({ level: 'no_chunks', left_bytes: 2e8 });
  assert.match(chunks, /✗\s*recordings refused.*200\sMB.*No recording is stored.*at once/s);
  const read_only = await shown({ level: 'read_only' });
  assert.match(read_only, /✗\s*read only.*not known yet.*nothing can be changed.*restarts it for writing/s);
  assert.match(await shown({ level: 'something_new', left_bytes: 1 }), /✗\s*something_new.*Make room/s);
});

test('nobody else is told', async () => {
  await logIn('mara', 'correct horse');
  assert.equal(await upkeep.room(), undefined);
});

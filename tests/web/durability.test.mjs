// What an acknowledgement survives, from the server's answer to the words on the page.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import { kDurabilities } from '../../client/web/app/lib/database.js';
import { upkeep } from '../../client/web/app/net/requests.js';
import { logIn } from '../../client/web/app/net/session.js';
import { StoreText } from '../../client/web/app/pages/upkeep.js';
import { fetchAsBrowser } from './support/browser_fetch.mjs';
import { startMock } from './mock_server.mjs';
import { textOf } from './support/page_text.mjs';

let mock;
fetchAsBrowser(() => mock.port);

before(async () => {
  mock = await startMock(0);
});
after(() => mock.close());

const shown = async (store) => {
  mock.lab.store = store;
  return textOf(StoreText({ store: await upkeep.store() }));
};

test('the words are those of the server, the weakest first', () => {
  const source = readFileSync(new URL('../../db/engine/engine.cpp', import.meta.url), 'utf8');
  const words = [...source.matchAll(/case Durability::\w+:\s+return "([\w ]+)";/g)].map(([, text]) => text);
  assert.deepEqual(Object.keys(kDurabilities), words);
  const openapi = readFileSync(new URL('../../server/web/openapi.cpp', import.meta.url), 'utf8');
  for (const text of words) assert.ok(openapi.includes(`"${text}"`), `${text} in the API's description`);
});

test('an administrator reads what a confirmed recording survives, and what to do', async () => {
  await logIn('root', 'correct horse');
  assert.match(
    await shown({ ack_survives: 'the loss of a disk' }),
    /✓\s*the loss of a disk.*two disks.*Nothing to do/s,
  );
  assert.match(
    await shown({ ack_survives: 'a power cut' }),
    /i\s*a power cut.*one disk.*backup on another disk.*standby/s,
  );
  assert.match(await shown({ ack_survives: 'the end of a program' }), /✗\s*the end.*power cut can lose.*fsync = on/s);
  assert.match(await shown({ ack_survives: 'nothing' }), /✗\s*nothing.*synchronous_commit = on/s);
  assert.match(await shown({ ack_survives: 'a meteor' }), /✗\s*a meteor.*does not know.*log says more/s);
});

test('a standby that is lost is told, and that it is back', async () => {
  await logIn('root', 'correct horse');
  const lost = await shown({ ack_survives: 'the loss of a disk', waits_s: 12.4 });
  assert.match(lost, /!\s*waits.*not confirmed a change for 12 s.*stations keep.*whether the standby runs/s);
  const refused = await shown({ ack_survives: 'the loss of a disk', refused: 'the connection was lost' });
  assert.match(refused, /✗\s*not stored.*the connection was lost.*stations keep.*continues by itself/s);
  assert.doesNotMatch(await shown({ ack_survives: 'the loss of a disk' }), /waits|not stored/);
});

test('what the database lacks of what was confirmed is told beside the rest', async () => {
  await logIn('root', 'correct horse');
  const lacks = await shown({
    ack_survives: 'a power cut',
    refused: 'no right',
    lack: 'transaction 7 is unknown here',
  });
  assert.match(lacks, /not stored.*no right.*✗\s*confirmed recordings are missing.*transaction 7.*steps.*a power cut/s);
  assert.doesNotMatch(await shown({ ack_survives: 'a power cut' }), /missing/);
});

test('nobody else is told', async () => {
  await logIn('mara', 'correct horse');
  assert.equal(await upkeep.store(), undefined);
});

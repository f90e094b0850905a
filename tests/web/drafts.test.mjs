// Drafts of forms in a tab's storage: whose they are, and when they go.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { draftAt, dropDrafts } from '../../client/web/app/lib/draft.js';

/** A Storage, as the HTML standard has it, of at most `room` characters. */
function storage(room = Infinity) {
  const all = new Map();
  return {
    all,
    get length() {
      return all.size;
    },
    key: (i) => [...all.keys()][i] ?? null,
    getItem: (place) => all.get(place) ?? null,
    setItem(place, text) {
      if (place.length + text.length > room) throw new DOMException('full', 'QuotaExceededError');
      all.set(place, text);
    },
    removeItem: (place) => all.delete(place),
  };
}

test('a draft comes back as it was, with the revision that it was made from', () => {
  const tab = storage();
  const kept = { value: { name: 'autumn', members: ['ana', 'ben'] }, base: 3 };
  draftAt('mara', 'group/a', tab).write(kept);
  assert.deepEqual(draftAt('mara', 'group/a', tab).read(), kept);
  assert.equal(draftAt('mara', 'group/b', tab).read(), null);
  draftAt('mara', 'group/a', tab).drop();
  assert.equal(draftAt('mara', 'group/a', tab).read(), null);
  assert.equal(tab.all.size, 0);
});

test('no other person gets it, even one whose name begins alike', () => {
  const tab = storage();
  draftAt('mara', 'm x', tab).write({ value: 1 });
  for (const [who, name] of [
    ['mar', 'm x'],
    ['mara m', 'x'],
    ['mara', 'x'],
    ['', 'mara m x'],
  ])
    assert.equal(draftAt(who, name, tab).read(), null, who);
});

test('another log-in removes the drafts of all others, a log-out all; what is no draft stays', () => {
  const tab = storage();
  tab.setItem('needlelab class list columns', '{}');
  for (const who of ['mara', 'mara m', 'milo', '']) draftAt(who, 'person', tab).write({ value: who });
  dropDrafts('mara', tab);
  assert.deepEqual(draftAt('mara', 'person', tab).read(), { value: 'mara' });
  assert.equal(tab.all.size, 2);
  dropDrafts(undefined, tab);
  assert.deepEqual([...tab.all.keys()], ['needlelab class list columns']);
});

test('a full storage keeps no older version of what is typed, and one that is forbidden or broken none at all', () => {
  const tab = storage(100);
  const draft = draftAt('mara', 'list', tab);
  draft.write({ value: 'short' });
  draft.write({ value: 'x'.repeat(100) });
  assert.equal(draft.read(), null);
  tab.setItem(tab.key(0) ?? 'needlelab draft "mara" list', '{"value":');
  assert.equal(draft.read(), null);
  const none = draftAt('mara', 'list', null);
  none.write({ value: 1 });
  none.drop();
  assert.equal(none.read(), null);
  dropDrafts('mara', null);
});

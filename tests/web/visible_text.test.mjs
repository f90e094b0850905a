import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { kHidden, visibleText } from '../../client/web/app/lib/visible_text.js';
import { options } from '../../client/web/vendor/preact.js';
import '../../client/web/app/ui/html.js';

const hex = (text) => parseInt(text, 16);
const pointsOf = (rows) =>
  new Set(rows.flatMap(([first, last]) => Array.from({ length: last - first + 1 }, (_, i) => first + i)));

test('the console writes out the characters that the server refuses in new names', () => {
  const source = readFileSync(new URL('../../common/base/text/text.cpp', import.meta.url), 'utf8');
  const table = source.slice(source.indexOf('kHidden[] = {'), source.indexOf('};', source.indexOf('kHidden[] = {')));
  const rows = [...table.matchAll(/\{0x([0-9a-f]+), 0x([0-9a-f]+), "/g)].map(([, first, last]) => [
    hex(first),
    hex(last),
  ]);
  assert.ok(rows.length > 20);
  assert.deepEqual(pointsOf(kHidden), pointsOf(rows));
});

test('a hidden character is written out, and nothing else changes', () => {
  for (const [text, shown] of [
    ['Tom\u202eegroeG', 'Tom[U+202E]egroeG'],
    ['a\u200bb\ufeff', 'a[U+200B]b[U+FEFF]'],
    ['x\u{e0041}', 'x[U+E0041]'],
    ['Tom\u200dSmith', 'Tom[U+200D]Smith'],
    ['\u200c\u0645', '[U+200C]\u0645'],
    ['Zoë Müller', 'Zoë Müller'],
    ['אברהם בן־דוד', 'אברהם בן־דוד'],
    ['محمدرضا', 'محمدرضا'],
    ['علی\u200cرضا', 'علی\u200cرضا'],
    ['क्\u200dष', 'क्\u200dष'],
    ['👩\u200d⚕️', '👩\u200d⚕️'],
  ])
    assert.equal(visibleText(text), shown);
});

test('each text of a page is written out, what a field holds is not', () => {
  const text = { type: null, props: 'a\u202eb' };
  options.vnode(text);
  assert.equal(text.props, 'a[U+202E]b');
  const field = { type: 'input', props: { value: 'a\u202eb' } };
  options.vnode(field);
  assert.equal(field.props.value, 'a\u202eb');
});

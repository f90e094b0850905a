// Text that is accepted as a document, and the text and the form that change one document.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  documentOf,
  textOf,
  withDocument,
  withOwnText,
  withText,
  written,
} from '../../client/web/app/lib/json_text.js';

test('a text is a document if the server could read it', () => {
  assert.deepEqual(documentOf('{"a": [1, null, "x", {"b": -0.5}]}'), { a: [1, null, 'x', { b: -0.5 }] });
  const refused = {
    NaN: /^This is not JSON yet: /,
    '{"a": NaN}': /^This is not JSON yet: /,
    '{"a": Infinity}': /^This is not JSON yet: /,
    null: /^A document must be an object in braces, found null$/,
    5: /found the number 5$/,
    '"x"': /found the text "x"$/,
    '[{}]': /found a list$/,
    '{"layers": [{"thickness_m": 1e999}]}': /^layers\[0\]\.thickness_m: is too large for a number$/,
    [`{"a": ${'['.repeat(32)}${']'.repeat(32)}}`]: /is nested deeper than 32$/,
    [`{"a": ${'['.repeat(1e5)}${']'.repeat(1e5)}}`]: /is nested deeper than 32$/,
  };
  for (const [text, words] of Object.entries(refused)) assert.throws(() => documentOf(text), { message: words });
  assert.ok(documentOf(`{"a": ${'['.repeat(31)}${']'.repeat(31)}}`), '32 deep');
});

test('a name that is given twice in one object is refused by its path, as the server refuses it', () => {
  const refused = {
    '{"a": 1, "a": 1}': 'a: is given twice',
    '{"layers": [{"x": 1}, {"name": "fat", "x": {"name": 2}, "name": "skin"}]}': 'layers[1].name: is given twice',
    '{"limb": {"plane": {}, "plane": {}}}': 'limb.plane: is given twice',
    '{"a": 1, "\\u0061": 2}': 'a: is given twice',
    '{"": 1, "": 2}': ': is given twice',
  };
  for (const [text, message] of Object.entries(refused)) assert.throws(() => documentOf(text), { message });
  const fine = '{"a": {"a": 1, "b": [{"a": 1}, {"a": 1}]}, "b": "a", "c": "{\\"a\\": 1, \\"a\\": 1,", "d": ["a", "a"]}';
  assert.deepEqual(documentOf(fine), JSON.parse(fine));
});

test('a whole number that would be rounded is refused by its path; one that is kept is not', () => {
  assert.throws(() => documentOf('{"exercises": [{}, {"due_unix_ms": 9007199254740993}]}'), {
    message:
      'exercises[1].due_unix_ms: 9007199254740993 is too large for a whole number, at most 9007199254740991 is kept',
  });
  assert.throws(() => documentOf('{"a": [0, -9007199254740992]}'), {
    message: /^a\[1\]: -9007199254740992 is too large/,
  });
  const kept = '{"a": [9007199254740991, -9007199254740991, 1e300, 0.1, -0.5e-3, "9007199254740993"]}';
  assert.deepEqual(documentOf(kept), JSON.parse(kept));
});

const a = written({ a: 1 }),
  b = written({ a: 2 });

test('a text that is a document goes along with the form, and the form with it', () => {
  const begun = textOf(a);
  assert.equal(withDocument(begun, a), begun);
  assert.deepEqual(withDocument(begun, b), textOf(b));
  const [typed, document] = withText(begun, '{"a":2}');
  assert.deepEqual(document, { a: 2 });
  // the document is that of the text, which stays as it was typed
  assert.equal(withDocument(typed, b).text, '{"a":2}');
  assert.equal(withDocument(typed, a).text, a, 'changed back elsewhere');
});

test('what the form changes under a text that is not a document is not overwritten by the next key', () => {
  const [broken, none] = withText(textOf(a), '{"a": 1,');
  assert.equal(none, undefined);
  assert.match(broken.problem, /^This is not JSON yet/);
  assert.equal(broken.apart, false);
  const apart = withDocument(broken, b);
  assert.deepEqual([apart.text, apart.apart], ['{"a": 1,', true], 'what was typed stays');
  const [valid, still_none] = withText(apart, '{"a": 1, "b": 3}');
  assert.equal(still_none, undefined, 'the form has a: 2');
  assert.deepEqual([valid.problem, valid.apart], ['', true]);
  // form and text stay apart until a person chooses, also when the form goes back
  assert.equal(withDocument(valid, a).apart, true);
  const [own, chosen] = withOwnText(valid);
  assert.deepEqual(chosen, { a: 1, b: 3 });
  assert.deepEqual([own.text, own.apart, own.held], ['{"a": 1, "b": 3}', false, written({ a: 1, b: 3 })]);
});

test('a text that is mended before the form changes is the document again', () => {
  const [broken] = withText(textOf(a), 'x');
  const [mended, document] = withText(withDocument(broken, a), b);
  assert.deepEqual(document, { a: 2 });
  assert.deepEqual(mended, textOf(b));
});

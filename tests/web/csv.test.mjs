import assert from 'node:assert/strict';
import { test } from 'node:test';
import { parseCsv, readTable, separatorOf, writeCsv } from '../../client/web/app/lib/csv.js';
import { random } from './mock/gesture.mjs';

test('quotes, doubled quotes and line breaks inside a cell', () => {
  const rows = parseCsv('a,b\r\n"Bauer, Anna","says ""no""\nand goes"\r\nc,d');
  assert.deepEqual(
    rows.map((r) => r.cells),
    [
      ['a', 'b'],
      ['Bauer, Anna', 'says "no"\nand goes'],
      ['c', 'd'],
    ],
  );
  assert.deepEqual(
    rows.map((r) => r.line),
    [1, 2, 4],
    'a row is named by the line of the file at which it begins',
  );
});

test('empty lines and a byte order mark are passed over', () => {
  assert.deepEqual(
    parseCsv('\ufeffname\n\n  \nanna\n').map((r) => [r.line, r.cells]),
    [
      [1, ['name']],
      [4, ['anna']],
    ],
  );
});

test('what spreadsheets write: semicolons and tabs', () => {
  assert.equal(separatorOf('name;role;"a,b,c,d"'), ';');
  assert.equal(separatorOf('name\trole'), '\t');
  assert.equal(separatorOf('name'), ',');
  assert.deepEqual(
    parseCsv('name;role\nanna;trainee').map((r) => r.cells),
    [
      ['name', 'role'],
      ['anna', 'trainee'],
    ],
  );
});

test('a quote that is never closed is an error that names its line', () => {
  assert.throws(() => parseCsv('a,b\nc,"d\ne,f\n'), /line 2/);
});

test('random tables survive writing and reading', () => {
  const seed = Number(process.env.NEEDLELAB_SEED ?? 11),
    next = random(seed);
  const marks = ['a', '"', ',', '\n', '\r\n', ';', ' ', 'é', '\t'];
  for (let round = 0; round < 300; round++) {
    const width = 2 + Math.floor(next() * 4);
    const table = Array.from({ length: 1 + Math.floor(next() * 5) }, () => [
      'x',
      ...Array.from({ length: width - 1 }, () =>
        Array.from({ length: Math.floor(next() * 6) }, () => marks[Math.floor(next() * marks.length)]).join(''),
      ),
    ]);
    assert.deepEqual(
      parseCsv(writeCsv(table), ',').map((r) => r.cells),
      table,
      `seed ${seed}, round ${round}`,
    );
  }
});

test('a class list says which columns it has, in any order and case', () => {
  const table = readTable('Role, NAME ,colour\ntrainee, anna ,red\n', ['name', 'role', 'group']);
  assert.deepEqual([table.unknown, table.missing], [['colour'], ['group']]);
  assert.deepEqual(table.rows, [{ line: 2, values: { role: 'trainee', name: 'anna', colour: 'red' } }]);
});

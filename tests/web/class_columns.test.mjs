// The header of a class list, changed to what a person chose.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  columnsOf,
  headerOf,
  kParts,
  remember,
  remembered,
  renamesOf,
  takenOf,
  withColumns,
} from '../../client/web/app/lib/class_columns.js';

const report = {
  rows: [
    { line: 1, column: 'Name', name: 'family_name', what: 'WHAT_UNSPECIFIED', text: 'is the family name' },
    { line: 1, column: 'Vorname', name: 'given_name', what: 'WHAT_UNSPECIFIED' },
    { line: 1, column: 'E-Mail (Uni)', name: '', what: 'WHAT_UNSPECIFIED', text: 'ignored' },
    { line: 1, column: 'Kurs', name: 'group', what: 'WHAT_UNSPECIFIED' },
    { line: 1, column: 'name', name: '', what: 'FAULT', text: 'no column is known as the account' },
  ],
};
const columns = columnsOf(report);

test('the form begins with what the server takes, and only words of the header change', () => {
  assert.deepEqual(
    columns.map((c) => c.cell),
    ['Name', 'Vorname', 'E-Mail (Uni)', 'Kurs'],
  );
  assert.deepEqual(takenOf(columns), { name: '', full_name: kParts, group: 'Kurs' });
  const csv = 'Klasse 3\r\n\r\nName;Vorname;"E-Mail (Uni)";Kurs\r\nName;Anna;a@b;Kurs\r\n';
  assert.equal(headerOf(csv, 1), 'Name;Vorname;"E-Mail (Uni)";Kurs');
  const changed = (chosen) => headerOf(withColumns(csv, 1, renamesOf(columns, chosen)), 1);
  const account = { name: 'E-Mail (Uni)', full_name: kParts, group: 'Kurs' };
  assert.equal(changed(account), 'Name;Vorname;"account";group');
  assert.equal(changed({ ...account, full_name: 'Name' }), 'full_name;Vorname (not used);"account";group');
  assert.equal(
    changed({ ...account, full_name: '', group: '' }),
    'Name (not used);Vorname (not used);"account";Kurs (not used)',
  );
  // "Name" is no part of "Vorname", and rows stay as they are
  assert.equal(
    withColumns(csv, 1, { Name: 'account' }),
    'Klasse 3\r\n\r\naccount;Vorname;"E-Mail (Uni)";Kurs\r\nName;Anna;a@b;Kurs\r\n',
  );
  assert.equal(withColumns('sep=,\nVorname, Name ,x\n', 0, { Name: 'account' }), 'sep=,\nVorname, account ,x\n');
  assert.equal(withColumns(csv, 1, null), csv);
  assert.equal(withColumns('', 5, { Name: 'account' }), '');
});

test('a choice is remembered for its header, forgotten on demand, and asked again where nothing can be stored', () => {
  const kept = new Map();
  globalThis.localStorage = { getItem: (key) => kept.get(key) ?? null, setItem: (key, text) => kept.set(key, text) };
  remember('a;b', { a: 'account' });
  remember('c;d', { d: 'group' });
  assert.deepEqual(remembered('a;b'), { a: 'account' });
  remember('a;b', null);
  assert.equal(remembered('a;b'), null);
  assert.deepEqual(remembered('c;d'), { d: 'group' });
  kept.set([...kept.keys()][0], '{broken');
  assert.equal(remembered('c;d'), null);
  delete globalThis.localStorage;
  remember('a;b', {});
  assert.equal(remembered('a;b'), null);
});

// The words of the console, by tables that hold for the programs in C++, too (tests/unit/common/scoring/measures/words_test.cpp).
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { isPractising, tileState, traineeWords } from '../../client/web/app/lib/lab.js';
import {
  meanText,
  measureText,
  placeMarks,
  placeWords,
  requirementText,
  rowRemark,
  rowTitle,
  shownUnit,
} from '../../client/web/app/lib/measures.js';
import { fieldUnit, messageIn, unitAt } from '../../client/web/app/lib/units.js';
import { cellState } from '../../client/web/app/pages/results.js';
import { Requirements } from '../../client/web/app/course/exercise.js';
import { Row } from '../../client/web/app/session/score.js';
import { textOf } from './support/page_text.mjs';

const en = { locale: 'en' };
const plain = (text) => text.replaceAll('\u00a0', ' ');
const table = (file) => JSON.parse(readFileSync(new URL(`../data/scoring/${file}`, import.meta.url), 'utf8'));
const kRawName = /\b[a-z]+(?:_[a-z0-9]+)+\b/;

test('values and limits read as in C++: shares in percent, yes and no in words', () => {
  const { values, requirements } = table('measure_texts.json');
  assert.ok(values.length >= 40);
  for (const { measure, unit, value, text } of values)
    assert.equal(plain(measureText(measure, value, unit, en)), text, measure);
  for (const { text, ...row } of requirements) assert.equal(plain(requirementText(row, en)), text, row.measure);
  assert.equal(measureText('target_reached', null, ''), '–');
  assert.equal(plain(meanText('target_reached', 0.82, '', en)), '82 %');
});

test('a share is edited and plotted in percent', () => {
  assert.deepEqual(shownUnit('injected_share', ''), { factor: 0.01, unit: '%' });
  assert.deepEqual(shownUnit('peak_force_layer_3_n', 'N'), { factor: 1, unit: 'N' });
  assert.deepEqual(shownUnit('target_distance_m', 'm'), { factor: 1e-3, unit: 'mm' });
  assert.equal(shownUnit('target_reached', '').unit, '1: yes, 0: no');
});

test('the picture of a place is that of C++, and on the side that the words name', () => {
  const rows = table('places.json').filter((row) => row.place);
  assert.ok(rows.length >= 8);
  for (const { says, experts, value, place, words, marks } of rows) {
    const found = placeMarks({ least: Math.min(...experts), greatest: Math.max(...experts), value });
    [found.least, found.greatest, found.value].forEach((at, i) => assert.ok(Math.abs(at - marks[i]) < 1e-8, says));
    const side = found.value < found.least ? 'below' : found.value > found.greatest ? 'above' : 'within';
    assert.equal(side, place, says);
    assert.match(words, new RegExp(`\\b${place} the experts' range`));
  }
});

test('beside the experts stands what the server says; where it says nothing, nothing does', () => {
  const row = { measure: 'clamping_work_j', value: 9.4e-5, unit: 'J', words: 'Work against clamping 0.094 mJ' };
  const { words } = table('places.json')[0];
  const beside = { measure: row.measure, value: row.value, least: 1e-6, greatest: 5e-6, place: 'above', words };
  assert.match(textOf(Row({ row, title: 'Work against clamping', beside })), /above the experts' range/);
  for (const none of [undefined, { ...beside, place: null, words: '' }])
    assert.doesNotMatch(textOf(Row({ row, title: 'Work against clamping', beside: none })), /expert|range/);
});

test('a row says each value once: words add only what value, limit and verdict do not say', () => {
  const row = { measure: 'peak_force_n', value: 2.5, unit: 'N', max: 5, passed: true };
  assert.equal(rowRemark({ ...row, words: 'Peak force 2.5 N: within the 5 N allowed' }), '');
  assert.equal(rowRemark({ ...row, passed: false, words: 'Peak force 5 N: just above the 5 N allowed' }), 'just above');
  assert.equal(rowRemark({ ...row, value: null, passed: false, words: 'You did not inject.' }), 'You did not inject.');
  assert.equal(rowRemark({ ...row, value: null, passed: undefined, words: 'You did not inject.' }), '');
  const words = "Peak force 2.5 N: below the experts' range, 3 N to 4 N (12 gestures)";
  assert.equal(placeWords({ words, n: 12 }, 12), "below the experts' range, 3 N to 4 N");
  assert.equal(placeWords({ words, n: 12 }, 14), "below the experts' range, 3 N to 4 N (12 gestures)");
  const beside = { ...row, n: 12, least: 3, greatest: 4, place: 'below', words };
  const text = textOf(
    Row({
      row: { ...row, words: 'Peak force 2.5 N: within the 5 N allowed' },
      title: 'Peak force',
      beside,
      experts: 12,
    }),
  );
  for (const value of ['2.5', '5 N', '3 N', '4 N', 'Peak force'])
    assert.equal(plain(text).split(new RegExp(`(?<![.\\d])${value}`)).length - 1, 1, `${value} in ${text}`);
});

test('a row of a score has a name and no identifier, measured or not', () => {
  const kinds = [
    { name: 'aspirated_before_injection', unit: '', words: 'Aspirated before the injection' },
    { name: 'mean_force_layer_K_n', unit: 'N', words: 'Mean force in layer K' },
  ];
  const missing = {
    measure: 'aspirated_before_injection',
    value: null,
    unit: '',
    min: 1,
    passed: false,
    words: 'You did not inject.',
  };
  assert.equal(rowTitle(missing, kinds), 'Aspirated before the injection');
  const layer = { measure: 'mean_force_layer_2_n', value: null, words: 'The needle was not in fat.' };
  assert.equal(rowTitle(layer, kinds, ['skin', 'fat']), 'Mean force in fat');
  assert.equal(rowTitle({ measure: 'of_no_kind', value: null, words: 'x' }, kinds), 'unknown measure');
  assert.equal(rowTitle({ measure: 'peak_force_n', value: 2, words: 'Peak force 2 N' }, kinds), 'Peak force');
  const text = textOf(Row({ row: missing, title: rowTitle(missing, kinds) }));
  assert.match(text, /Aspirated before the injection[\s\S]*You did not inject\.[\s\S]*not measured[\s\S]*yes/);
  assert.doesNotMatch(text, kRawName);
});

test('the measures to choose from have no identifier beside their names', () => {
  const kinds = [
    { name: 'peak_force_n', unit: 'N', words: 'Peak force' },
    { name: 'injected_share', unit: '', words: 'Share of the syringe injected' },
  ];
  const fields = [];
  const f = {
    at: () => [{ measure: 'injected_share', min: 0.5 }],
    faultAt: () => undefined,
    edit: () => {},
    select: (path, label, options) => options.map(([, words]) => words).join('; '),
    number: (path, label, more) => {
      fields.push([label, more]);
      return '';
    },
  };
  const text = textOf(Requirements({ f, at: 'exercises[0]', measures: kinds, layers: [] }));
  assert.match(text, /Choose …; Peak force; Share of the syringe injected/);
  assert.doesNotMatch(text, kRawName);
  assert.deepEqual(fields, [
    ['At least', { factor: 0.01, unit: '%' }],
    ['At most', { factor: 0.01, unit: '%' }],
  ]);
});

test('a range is in the unit of the field that it stands under', () => {
  const cases = [
    ['thickness_m', '-0.003 is out of range (0, 1]', '-3 mm is out of range: allowed is more than 0, at most 1000 mm'],
    [
      'center_m.x',
      '1001 is out of range [-1000, 1000]',
      '1001000 mm is out of range: allowed is -1000000 to 1000000 mm',
    ],
    [
      'bevel_angle_rad',
      '2 is out of range (0, 1.5707963267948966]',
      '114.592 ° is out of range: allowed is more than 0, at most 90 °',
    ],
    ['young_pa', '1e+07 is out of range [100, 1e+06]', '10000 kPa is out of range: allowed is 0.1 to 1000 kPa'],
    ['cutting_force_n', '75 is out of range [0, 50]', '75 N is out of range: allowed is 0 to 50 N'],
    ['gauge', '40 is out of range [7, 34]', '40 is out of range: allowed is 7 to 34'],
    ['thickness_m', 'must be a number, found the text "a"', 'must be a number, found the text "a"'],
    ['radius_m', 'is above the 0.01 of its layer', 'is above the 0.01 of its layer (in m, not mm)'],
  ];
  for (const [name, message, said] of cases) {
    assert.equal(messageIn(message, unitAt(`layers[0].${name}`)), said);
    assert.deepEqual(unitAt(`layers[0].${name}`), fieldUnit(name.replace(/\.x$/, '')));
  }
});

test('a tile never says that no one practises', () => {
  const idle = { online: true, session_id: '', trainee: '' };
  const lesson = { online: true, session_id: '0199-1', trainee: '' };
  assert.deepEqual(tileState(idle), ['info', 'idle']);
  assert.deepEqual(tileState(lesson), ['good', 'practising']);
  assert.equal(isPractising(lesson), true);
  assert.equal(traineeWords(lesson), 'Name not known yet');
  assert.equal(traineeWords({ ...lesson, trainee: 'anna' }), 'anna');
  assert.equal(traineeWords({ ...lesson, trainee: 'anna', trainee_full_name: 'Anna Bauer' }), 'Anna Bauer');
  assert.deepEqual(tileState({ ...lesson, online: false }), ['open', 'offline']);
  assert.equal(isPractising({ ...lesson, online: false }), false);
  assert.deepEqual(tileState({ ...lesson, fault: 'too fast' }), ['bad', 'fault']);
});

test('an exercise that was tried in vain is not called open', () => {
  const cell = { locked_by: [], attempts: 3 };
  assert.deepEqual(cellState({ ...cell, passed: false }), ['bad', 'not passed']);
  assert.deepEqual(cellState({ ...cell }), ['info', 'practised']);
  assert.deepEqual(cellState({ ...cell, attempts: 0 }), ['open', 'not started']);
});

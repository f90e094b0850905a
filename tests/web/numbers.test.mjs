import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { ago, backoff, clock, day, fromInput, moment, toInput } from '../../client/web/app/lib/time.js';
import { indexAt, minMax } from '../../client/web/app/lib/decimate.js';
import { layerNames } from '../../client/web/app/lib/tissue.js';
import {
  atStart,
  bytes,
  csvSeparator,
  fieldUnit,
  measureTitle,
  quantity,
  shown,
  typed,
  words,
} from '../../client/web/app/lib/units.js';
import { advance, atRest, loaded, seek, toggle } from '../../client/web/app/lib/recording.js';
import { random } from './mock/gesture.mjs';

const en = { locale: 'en' };
const plain = (text) => text.replace('\u00a0', ' ');

test('quantities have the units that people say and the digits that matter', () => {
  const cases = [
    [0.0031, 'm', '3.1 mm'],
    [0.35, 'm', '350 mm'],
    [1.234, 'm', '1.23 m'],
    [0.99996e-3, 'm', '1 mm'],
    [-0.002, 'm', '-2 mm'],
    [0, 'm', '0 mm'],
    [0.35, 'N', '0.35 N'],
    [0.004, 'N', '0.004 N'],
    [0.0087, 'N', '0.009 N'],
    [-0.0087, 'N', '-0.009 N'],
    [0.00002, 'N', '0 N'],
    [12.34, 'N', '12.3 N'],
    [1500, 'N', '1500 N'],
    [0.0123, 'J', '12.3 mJ'],
    [5e-6, 'J', '0.005 mJ'],
    [0.002, 'N·m', '0.002 N·m'],
    [0.0012, 'm^2', '12 cm²'],
    [0.05, 'm/s', '50 mm/s'],
    [2, '', '2'],
    [0.5, 'share', '50 %'],
    [0.082, 'share', '8 %'],
    [1.5e-6, 'm', '0.002 mm'],
    [0.0000321, 'm', '0.032 mm'],
    [0.02, 'Pa', '20 mPa'],
    [2500, 'Pa', '2.5 kPa'],
  ];
  for (const [value, unit, text] of cases) assert.equal(plain(quantity(value, unit, en)), text);
  for (const nothing of [null, undefined, NaN, Infinity]) assert.equal(quantity(nothing, 'm', en), '–');
  assert.equal(plain(quantity(0.0031, 'm', { locale: 'de' })), '3,1 mm');
});

test('a table has semicolons where numbers have decimal commas', () => {
  for (const locale of ['de', 'fr', 'pt-BR', 'nb', 'nl', 'pl']) assert.equal(csvSeparator(locale), 'semicolon', locale);
  for (const locale of ['en', 'en-US', 'de-CH', 'ja', 'he']) assert.equal(csvSeparator(locale), 'comma', locale);
});

test('what is typed in millimetres is stored in metres and comes back as it was typed', () => {
  const { factor, unit } = fieldUnit('thickness_m');
  assert.equal(unit, 'mm');
  for (const text of ['3', '0.1', '12.345', '1e-3', '0.3']) {
    const si = typed(text, factor);
    assert.equal(typed(shown(si, factor), factor), si);
    assert.equal(Number(shown(si, factor)), Number(text));
  }
  assert.equal(typed('3', factor), 0.003);
  assert.equal(typed('3,5', factor), 0.0035);
});

test('angles survive the way through degrees', () => {
  const { factor } = fieldUnit('bevel_angle_rad');
  assert.ok(Math.abs(typed(shown(0.3, factor), factor) - 0.3) < 1e-11);
});

test('the longest ending of a name decides its unit', () => {
  const wanted = {
    stiffness_n_per_m: 'N/m',
    lateral_stiffness_n_per_m2: 'N/m²',
    max_torque_nm: 'N·m',
    stop_speed_m_s: 'mm/s',
    cutting_force_n: 'N',
    stiffness_nm_per_rad: 'N·m/rad',
    attempts: '',
    young_pa: 'kPa',
    damping_ns_per_m: 'N·s/m',
    viscous_in_ns_per_m2: 'N·s/m²',
  };
  for (const [name, unit] of Object.entries(wanted)) assert.equal(fieldUnit(name).unit, unit, name);
});

test('nothing and no number are told apart', () => {
  assert.equal(typed('  ', 1), undefined);
  for (const bad of ['abc', '1..2', '1e', '--3', 'Infinity', 'NaN', '1e999', '0x10'])
    assert.equal(typed(bad, 1), null, bad);
  for (const [text, value] of [
    ['.5', 0.5],
    ['5.', 5],
    ['+1', 1],
    ['−2', -2],
    ['1e3', 1000],
  ])
    assert.equal(typed(text, 1), value);
});

test('three digits behind the sign of thousands are asked about, where both numbers are allowed', () => {
  const one_of = (text, locale, field = {}) => {
    const got = typed(text, field.factor ?? 1, { locale, ...field });
    return got?.asks?.join(' or ') ?? got;
  };
  // the signs of each language, by the Unicode CLDR
  for (const [locale, comma, point] of [
    ['en-US', '1.2 or 1200', 1.2],
    ['en-IN', '1.2 or 1200', 1.2],
    ['ja', '1.2 or 1200', 1.2],
    ['de', 1.2, '1.2 or 1200'],
    ['es', 1.2, '1.2 or 1200'],
    ['pt-BR', 1.2, '1.2 or 1200'],
    ['id', 1.2, '1.2 or 1200'],
    ['fr', 1.2, 1.2],
    ['de-CH', 1.2, 1.2],
    ['nb', 1.2, 1.2],
  ]) {
    assert.equal(one_of('1,200', locale), comma, `1,200 in ${locale}`);
    assert.equal(one_of('1.200', locale), point, `1.200 in ${locale}`);
  }
  for (const [text, meant] of [
    ['12,345', '12.345 or 12345'],
    ['-1,500', '-1.5 or -1500'],
    ['1,000', '1 or 1000'],
    ['0,350', 0.35],
    ['1,2', 1.2],
    ['1,20', 1.2],
    ['1,2000', 1.2],
    ['1234,567', 1234.567],
    ['1.200', 1.2],
    ['1200', 1200],
    ['1,200,000', null],
  ])
    assert.equal(one_of(text, 'en-GB'), meant, text);
  // what the answer puts into the field is asked about in no language
  for (const locale of ['en', 'de', 'fr']) for (const n of ['1.2', '1200']) assert.equal(one_of(n, locale), Number(n));
});

test('no question where only one of the two numbers is allowed', () => {
  const mm = { locale: 'en', most: 1 };
  assert.equal(typed('1,200', 1e-3, mm), 0.0012, '1200 mm are more than a metre');
  assert.deepEqual(typed('1,000', 1e-3, mm), { asks: ['1', '1000'] }, '1000 mm are just a metre');
  assert.equal(typed('1,200', 1, { locale: 'en', whole: true, most: 36500 }), 1200, 'no day is 1.2');
  assert.deepEqual(typed('2,000', 1, { locale: 'en', whole: true, most: 36500 }), { asks: ['2', '2000'] });
  assert.equal(typed('1,200', 1, { locale: 'en', most: 1 }), 1.2, 'neither: as written, and the server says its range');
});

test('digits of other scripts are digits', () => {
  for (const text of ['١٢٠', '۱۲۰', '१२०', '１２０', '๑๒๐', '𝟏𝟐𝟎', '𝟙𝟚𝟘']) assert.equal(typed(text, 1), 120, text);
  assert.equal(typed('٣٫٥', 1), 3.5);
  assert.equal(typed('３．５', 1), 3.5);
  assert.equal(typed('-۳,۵', 1), -3.5);
  assert.deepEqual(typed('１，２００', 1, { locale: 'en' }), { asks: ['1.2', '1200'] });
  assert.equal(typed('３²', 1), null, 'a power is no digit');
});

test('names and sizes as people read them', () => {
  assert.equal(words('CURRICULUM_MANAGER'), 'Curriculum manager');
  assert.equal(plain(bytes(12_400_000, 'en')), '12.4 MB');
  assert.equal(plain(bytes(512, 'en')), '512 B');
});

test('the layers of a volume are its structures, by their names or ids', () => {
  const structures = [
    { id: 'dermis', layer: { tissue: 'SKIN', name: 'skin' } },
    { id: 'fat', layer: { tissue: 'FAT' } },
  ];
  assert.deepEqual(layerNames({ volume: { structures } }), ['skin', 'fat']);
  assert.deepEqual(layerNames({ volume: { structures: [null, { id: 5 }] } }), ['', '']);
});

test('layers are called as the programs in C++ call them', () => {
  const rows = JSON.parse(readFileSync(new URL('../data/profile/layer_names.json', import.meta.url), 'utf8'));
  assert.ok(rows.length >= 6);
  for (const { says, layers, names } of rows) assert.deepEqual(layerNames({ layers }), names, says);
  // while one types: a name that was emptied, a layer without a tissue, no profile
  assert.deepEqual(layerNames({ layers: [{ tissue: 'FAT', name: '' }, {}] }), ['fat', 'layer 2']);
  assert.deepEqual(layerNames(null), []);
  // and values of any type, in the JSON of a profile
  assert.deepEqual(layerNames({ layers: [{ tissue: 5 }, { tissue: 'FAT', name: 5 }, null, 7] }), [
    'layer 1',
    'fat',
    'layer 3',
    'layer 4',
  ]);
  for (const layers of [5, 'SKIN', {}, null]) assert.deepEqual(layerNames({ layers }), []);
  assert.equal(atStart('epidural space'), 'Epidural space');
  assert.equal(atStart(5), '5');
  assert.equal(atStart(null), '');
});

test('a measure is called by its words without value and verdict', () => {
  const cases = {
    'Peak force 2.52 N: within the 5 N allowed': 'Peak force',
    'Tissue swept by the shaft 0.218 cm²': 'Tissue swept by the shaft',
    'Smoothness (LDLJ) -16.6': 'Smoothness (LDLJ)',
    'Peak force in layer 5 (TENDON) 2.14 N': 'Peak force in layer 5 (TENDON)',
    'Peak force in ligamentum flavum 2.14 N: above the 2 N allowed': 'Peak force in ligamentum flavum',
    'Peak force in root C5: left 2 N: just above the 2 N allowed': 'Peak force in root C5: left',
    'Peak force in root C5: left 2 N': 'Peak force in root C5: left',
    'Peak force in tendon 2 2.14 N': 'Peak force in tendon 2',
    'Peak force in C5: above the root 2.14 N': 'Peak force in C5: above the root',
    'Peak force in C5: within the sheath 2.14 N: above the 2 N allowed': 'Peak force in C5: within the sheath',
    'Peak force in C5: at least 3 mm 2.14 N: just below the 2.14 N asked for': 'Peak force in C5: at least 3 mm',
    'Peak force in fat 2.14 N: within 1 N to 3 N': 'Peak force in fat',
    'Target not reached: it had to be': 'Target not reached',
    'Aspirated before the injection: this was not allowed': 'Aspirated before the injection',
    'Mean force in layer 4 0 N': 'Mean force in layer 4',
    'Mean speed 11.6 mm/s': 'Mean speed',
    'Entries 1: within the 2 allowed': 'Entries',
    'Target reached': 'Target reached',
    'Way over its own straight way 1.04': 'Way over its own straight way',
    "Largest distance from the needle's own line 3.2e-05 m": "Largest distance from the needle's own line",
    'Angle to the planned line 6.38°: above the 5° allowed': 'Angle to the planned line',
  };
  for (const [words, title] of Object.entries(cases)) assert.equal(measureTitle({ measure: 'x', words }), title);
  assert.equal(measureTitle({ measure: 'peak_force_n' }), 'peak_force_n');
});

test('decimation keeps every peak, the ends and the order', () => {
  const seed = Number(process.env.NEEDLELAB_SEED ?? 3),
    next = random(seed);
  for (let round = 0; round < 50; round++) {
    const n = 1 + Math.floor(next() * 5000),
      buckets = 1 + Math.floor(next() * 300);
    const x = Array.from({ length: n }, (_, i) => i),
      y = x.map(() => (next() < 0.02 ? NaN : next() - 0.5));
    const few = minMax(x, y, buckets);
    const finite = y.filter(Number.isFinite),
      kept = few.y.filter(Number.isFinite);
    const where = `seed ${seed}, round ${round}: n ${n}, buckets ${buckets}`;
    assert.ok(few.x.length <= Math.max(2 * buckets + 2, 0) || few.x.length === n, where);
    assert.equal(Math.max(...kept), Math.max(...finite), where);
    assert.equal(Math.min(...kept), Math.min(...finite), where);
    assert.equal(few.x[0], 0);
    assert.equal(few.x.at(-1), n - 1);
    assert.ok(
      few.x.every((v, i) => i === 0 || v > few.x[i - 1]),
      where,
    );
    assert.ok(
      few.x.every((v, i) => Object.is(few.y[i], Number.isFinite(y[v]) ? y[v] : null)),
      where,
    );
  }
  assert.deepEqual(minMax([], [], 5), { x: [], y: [] });
});

test('a stretch without values stays a gap', () => {
  const x = Array.from({ length: 1000 }, (_, i) => i);
  const few = minMax(
    x,
    x.map((i) => (i >= 400 && i < 600 ? NaN : i)),
    10,
  );
  assert.ok(few.y.includes(null));
});

test('the sample of a moment is the last one before it', () => {
  const t = [0, 0.5, 1, 1, 2];
  for (const [at, index] of [
    [-1, 0],
    [0, 0],
    [0.7, 1],
    [1, 3],
    [5, 4],
  ])
    assert.equal(indexAt(t, at), index);
});

test('times of recordings and dates of forms', () => {
  assert.equal(clock(65.34), '1:05.3');
  assert.equal(clock(59.96), '1:00.0');
  assert.equal(clock(0), '0:00.0');
  const half_past_two = new Date(2026, 2, 29, 14, 30).getTime();
  assert.equal(toInput(half_past_two), '2026-03-29T14:30');
  assert.equal(fromInput(toInput(half_past_two)), half_past_two);
  assert.equal(fromInput(''), undefined);
});

test('times of day are those of the place, in summer and in winter', () => {
  const before = process.env.TZ;
  process.env.TZ = 'America/St_Johns';
  try {
    // 2 h 30 min behind UTC in summer, 3 h 30 min in winter: still the day before
    const summer = Date.UTC(2026, 6, 1, 12, 4),
      winter = Date.UTC(2026, 0, 1, 2, 0);
    assert.equal(moment(summer, 'en-GB'), '1 Jul 2026, 09:34');
    assert.equal(day(winter, 'en-GB'), '31 Dec 2025');
    assert.equal(toInput(winter), '2025-12-31T22:30');
  } finally {
    if (before === undefined) delete process.env.TZ;
    else process.env.TZ = before;
  }
});

test('back-off doubles to its bound and takes off at most a quarter', () => {
  const least = { first_ms: 500, most_ms: 15_000, random: () => 1 },
    most = { ...least, random: () => 0 };
  assert.deepEqual(
    [0, 1, 2, 5, 60].map((n) => backoff(n, most)),
    [500, 1000, 2000, 15_000, 15_000],
  );
  assert.deepEqual(
    [0, 60].map((n) => backoff(n, least)),
    [375, 11_250],
  );
});

test('a replay runs at its speed, stops at the end, and begins again', () => {
  let p = { ...toggle(atRest(1, 5)), speed: 2 };
  p = advance(p, 1.5);
  assert.deepEqual([p.at_s, p.playing], [4, true]);
  p = advance(p, 3);
  assert.deepEqual([p.at_s, p.playing], [5, false]);
  assert.equal(advance(p, 1), p);
  assert.deepEqual([toggle(p).at_s, toggle(p).playing], [1, true]);
  assert.equal(seek(p, -3).at_s, 1);
  // a remark that was clicked before the recording came
  const early = seek(atRest(0, 0), 2.5);
  assert.equal(early.at_s, 0);
  assert.equal(loaded(early, 0, 9).at_s, 2.5);
  assert.equal(loaded(early, 0, 2).at_s, 2);
  assert.equal(loaded(loaded(early, 0, 9), 1, 9).at_s, 1, 'another recording begins at its beginning');
});

test('how long ago, by the days of the calendar', () => {
  const noon = new Date(2026, 10, 30, 12).getTime(),
    late = new Date(2026, 10, 29, 23, 59).getTime();
  assert.equal(ago(noon - 3_600_000, noon, 'en'), 'today');
  assert.equal(ago(late, noon, 'en'), 'yesterday');
  assert.equal(ago(late - 4 * 86_400_000, noon, 'en'), '5 days ago');
});

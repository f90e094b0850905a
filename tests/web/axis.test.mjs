import assert from 'node:assert/strict';
import { test } from 'node:test';
import { axisRange, kLeastSpans, limitsOf, quantityOfUnit } from '../../client/web/app/lib/axis.js';
import { random } from './mock/gesture.mjs';

const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-9, `${a} is not ${b}`);
const span = ([low, high]) => high - low;

test('an empty plot shows the least span of its quantity, from zero', () => {
  for (const [quantity, least] of Object.entries(kLeastSpans)) {
    assert.deepEqual(axisRange(null, null, quantity), [0, least], quantity);
    assert.deepEqual(axisRange(0, 0, quantity), [0, least], `${quantity}, a flat zero`);
  }
});

test('data that span less are centred in the least span', () => {
  for (const [low, high] of [
    [149.7, 149.8],
    [149.7, 149.7],
    [-80.05, -80.02],
  ]) {
    const range = axisRange(low, high, 'depth');
    near(span(range), kLeastSpans.depth);
    near((range[0] + range[1]) / 2, (low + high) / 2);
  }
});

test('a quantity that is never negative gets no negative axis, and one that is never positive no positive one', () => {
  assert.deepEqual(axisRange(0, 0.03, 'distance'), [0, kLeastSpans.distance]);
  assert.deepEqual(axisRange(0.3, 0.5, 'force'), [0, kLeastSpans.force]);
  assert.deepEqual(axisRange(-0.5, -0.4, 'force'), [-kLeastSpans.force, 0]);
  const [low, high] = axisRange(-0.1, 0.2, 'force');
  near(low + high, 0.1);
});

test('the axis contains data and limits, and is never narrower than the least span', () => {
  const seed = Number(process.env.NEEDLELAB_SEED ?? 7),
    next = random(seed);
  for (let round = 0; round < 300; round++) {
    const quantity = Object.keys(kLeastSpans)[Math.floor(next() * 10)],
      a = (next() - 0.5) * 10 ** (4 * next() - 2),
      b = a + next() * 10 ** (4 * next() - 3),
      at = 10 * next();
    const range = axisRange(a, b, quantity, [{ at, label: '' }]),
      where = `seed ${seed}, round ${round}: ${a} to ${b}, ${quantity}`;
    assert.ok(range[0] <= Math.min(a, at) && range[1] >= Math.max(b, at), where);
    assert.ok(span(range) >= kLeastSpans[quantity] - 1e-9, where);
    if (a >= 0) assert.ok(range[0] >= 0, where);
  }
});

test('the limits of an exercise are lines in shown units', () => {
  const rows = [
    { measure: 'peak_force_n', max: 5 },
    { measure: 'greatest_depth_m', min: 0.02, max: 0.03 },
    { measure: 'entries', max: 2 },
  ];
  assert.deepEqual(
    limitsOf('force', rows, 1, (v) => `${v} N`),
    [{ at: 5, label: 'at most 5 N' }],
  );
  assert.deepEqual(
    limitsOf('depth', rows, 1000, (v) => `${1000 * v} mm`),
    [
      { at: 20, label: 'at least 20 mm' },
      { at: 30, label: 'at most 30 mm' },
    ],
  );
  assert.deepEqual(limitsOf('speed', rows, 1, String), []);
  assert.deepEqual(limitsOf('force', undefined, 1, String), []);
});

test('each shown unit of a measure has a quantity', () => {
  for (const unit of ['', 'N', 'mm', 'mm/s', 's', 'cm²', 'J', '%'])
    assert.ok(kLeastSpans[quantityOfUnit(unit)] > 0, unit);
  assert.equal(quantityOfUnit('kg'), undefined);
});

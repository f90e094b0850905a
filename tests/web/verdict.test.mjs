import assert from 'node:assert/strict';
import { test } from 'node:test';
import { moment } from '../../client/web/app/lib/time.js';
import { kVerdicts, stiffnessShareText, trendOf, trendOfAll, verdictOf } from '../../client/web/app/lib/verdict.js';
import { CourseName } from '../../client/web/app/pages/courses.js';
import { cellState } from '../../client/web/app/pages/results.js';
import { Verdict, whyItWaits } from '../../client/web/app/pages/sessions.js';
import { Row } from '../../client/web/app/session/score.js';

/** All text of a tree of elements, components inside it not drawn. */
const textOf = (node) =>
  Array.isArray(node)
    ? node.map(textOf).join('')
    : typeof node === 'object'
      ? textOf(node?.props?.children ?? '')
      : typeof node === 'boolean'
        ? ''
        : String(node ?? '');

test('a verdict has one name, whatever page it stands on', () => {
  const names = new Map(kVerdicts);
  assert.deepEqual(
    [...names],
    [
      ['passed', 'passed'],
      ['failed', 'not passed'],
      ['none', 'no verdict'],
    ],
  );
  const cell = { locked_by: [], attempts: 1 };
  for (const [passed, code, kind] of [
    [true, 'passed', 'good'],
    [false, 'failed', 'bad'],
    [undefined, 'none', 'open'],
    [null, 'none', 'open'],
  ]) {
    assert.deepEqual(verdictOf(passed), [kind, names.get(code)]);
    assert.equal(textOf(Verdict({ of: { passed } })), names.get(code));
    if (typeof passed === 'boolean') assert.deepEqual(cellState({ ...cell, passed }), verdictOf(passed));
  }
});

test('a session that was rendered softer than its profile says so beside the score, in the words of the station', () => {
  assert.equal(
    stiffnessShareText({ stiffness_share: 0.551 }),
    "Fixture, bone, palpation and orientation limit were rendered at 55 % of the profile's stiffness. This device and tool cannot hold more.",
  );
  const device_notes = ['The needle is mounted.', 'Across … N·m/rad. BONE is not live: the needle cuts bone.'];
  assert.equal(
    stiffnessShareText({ stiffness_share: 0.551, device_notes }),
    "Bone was left out: the needle cut it as it cuts a layer of tissue. Fixture, palpation and orientation limit were rendered at 55 % of the profile's stiffness. This device and tool cannot hold more.",
  );
  assert.equal(
    stiffnessShareText({ device_notes }),
    'Bone was left out: the needle cut it as it cuts a layer of tissue. This device and tool cannot hold more.',
  );
  assert.equal(
    stiffnessShareText({ stiffness_share: 1, delay_stiffness_share: 0.758 }),
    "Because the device's force comes late, what acts along the needle was rendered at 76 % of the profile's stiffness: the tissue's forces are the same, over a longer way.",
  );
  // absent: all of it; others are not shares
  for (const stiffness_share of [undefined, null, 1, 0, -1, 2, 'NaN'])
    assert.equal(stiffnessShareText({ stiffness_share }), '');
});

test('of an exam whose results are held back a page says from when on they are shown, and no verdict', () => {
  const results_from_unix_ms = Date.UTC(2026, 5, 3, 12);
  const said = `result from ${moment(results_from_unix_ms)}`;
  assert.equal(textOf(Verdict({ of: { results_from_unix_ms } })), said);
  const cell = { locked_by: [], attempts: 1, attempts_left: 1, results_from_unix_ms };
  assert.deepEqual(cellState(cell), ['info', 'taken']);
  assert.deepEqual(cellState({ ...cell, attempts_left: 0 }), ['info', 'taken'], 'nothing is bad about it');
  assert.deepEqual(cellState({ ...cell, attempts: 0 }), ['open', 'not started']);
});

test('a session that waits says why, and first what no one can confirm', () => {
  assert.deepEqual(
    [{ begin_unsure: true, not_assigned: true }, { not_assigned: true }, { code_unchecked: true }, {}].map(
      (session) => whyItWaits(session)[0],
    ),
    ['clock', 'not assigned', 'no code', 'unknown'],
  );
});

test('the list of courses says of an exam that it is one, beside its name', () => {
  assert.match(textOf(CourseName({ course: { id: 'e', name: 'Autumn', exam: true } })), /^\s*Autumn\s+exam\s*$/);
  assert.match(textOf(CourseName({ course: { id: 'e', name: 'Autumn', exam: false } })), /^\s*Autumn\s*$/);
});

test('a trend is better, as before or worse, by what is better of the measure and by chance', () => {
  const row = (measure, better, tau, p) => ({ measure, better, trend: { slope_per_attempt: tau, tau, p } });
  for (const [better, tau, p, kind, word] of [
    ['less', -0.8, 0.01, 'good', 'better'],
    ['less', 0.8, 0.01, 'bad', 'worse'],
    ['more', 0.8, 0.05, 'good', 'better'],
    ['more', -0.8, 0.05, 'bad', 'worse'],
    ['more', -0.8, 0.06, 'info', 'as before'],
    ['neither', 0.8, 0.01, 'info', 'rises'],
    ['neither', -0.8, 0.01, 'info', 'falls'],
  ])
    assert.deepEqual(trendOf(row('m', better, tau, p)), [kind, word]);
  const few = ['open', 'too few attempts yet'];
  assert.deepEqual(trendOf({ measure: 'm', better: 'less', trend: null }), few);
  assert.deepEqual(trendOf(undefined), few);

  const rows = [
    row('a', 'less', -1, 0.01),
    row('b', 'less', -1, 0.01),
    row('c', 'more', -1, 0.01),
    row('d', 'less', 1, 0.5),
    { measure: 'e', better: 'less', trend: null },
  ];
  assert.deepEqual(trendOfAll(rows, ['a', 'b', 'c', 'd', 'e']), ['good', 'better']);
  assert.deepEqual(trendOfAll(rows, ['a', 'c', 'd']), ['info', 'as before']);
  assert.deepEqual(trendOfAll(rows, ['c', 'd']), ['bad', 'worse']);
  assert.deepEqual(trendOfAll(rows, ['e']), few, 'what is not required does not count');
});

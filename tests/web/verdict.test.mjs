import assert from 'node:assert/strict';
import { test } from 'node:test';
import { kVerdicts, stiffnessShareText, verdictOf } from '../../client/web/app/lib/verdict.js';
import { cellState } from '../../client/web/app/pages/results.js';
import { Verdict } from '../../client/web/app/pages/sessions.js';
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
    assert.equal(textOf(Verdict({ passed })), names.get(code));
    if (typeof passed === 'boolean') assert.deepEqual(cellState({ ...cell, passed }), verdictOf(passed));
  }
});

test('a measure beside the experts has their range and words, and no count of standard deviations', () => {
  const row = { measure: 'peak_force_n', value: 3, unit: 'N', words: 'Peak force 3 N' };
  const band = { measure: 'peak_force_n', n: 5, mean: 1.25, least: 1, greatest: 1.5 };
  const beside = { measure: 'peak_force_n', z: -373.25, words: 'Peak force 3 N: far from the experts' };
  const text = textOf(Row({ row, band, beside }));
  assert.match(text, /1\u00a0N to 1[.,]5\u00a0N/);
  assert.match(text, /far from the experts/);
  assert.doesNotMatch(text, /z\s*=|373/);
});

test('a session that was rendered softer than its profile says so beside the score, in the words of the station', () => {
  assert.equal(
    stiffnessShareText({ stiffness_share: 0.551 }),
    "Fixture, bone and orientation limit were rendered at 55 % of the profile's stiffness. Device and tool hold no more.",
  );
  const device_notes = ['The needle is mounted.', 'Across … N·m/rad. BONE is not live: the needle cuts bone.'];
  assert.equal(
    stiffnessShareText({ stiffness_share: 0.551, device_notes }),
    "Bone was left out: the needle cut it as it cuts a layer of tissue. Fixture and orientation limit were rendered at 55 % of the profile's stiffness. Device and tool hold no more.",
  );
  assert.equal(
    stiffnessShareText({ device_notes }),
    'Bone was left out: the needle cut it as it cuts a layer of tissue. Device and tool hold no more.',
  );
  // absent: all of it; others are no shares
  for (const stiffness_share of [undefined, null, 1, 0, -1, 2, 'NaN'])
    assert.equal(stiffnessShareText({ stiffness_share }), '');
});

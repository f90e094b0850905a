// What a form shows of a document of wrong types.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { courseFaults, planGivenBy, withExerciseId, withoutExercise } from '../../client/web/app/lib/course_rules.js';
import { isOfTissueNotMet, measureNamed, measuresOf } from '../../client/web/app/lib/measures.js';
import { toggled, withValue } from '../../client/web/app/lib/paths.js';
import { layerBounds } from '../../client/web/app/lib/scene.js';
import { kCourseShape, kProfileShape, shownOf } from '../../client/web/app/lib/shape.js';
import { clock, toInput } from '../../client/web/app/lib/time.js';
import { counted, newest, shown, typed } from '../../client/web/app/lib/units.js';
import { kTypes, typeFaultsOf } from './mock/document_types.mjs';

const skin = { tissue: 'SKIN', thickness_m: 0.003 };

test('a right document is shown as it is, also what the form does not know', () => {
  const profile = { id: 'a', layers: [{ ...skin, later: 5 }], targets: [], later: { x: null }, effects: ['LATER'] };
  assert.deepEqual(shownOf(profile, kProfileShape), { shown: profile, faults: [] });
});

test('a value of a wrong type is left out, and named as the server names it; items keep their places', () => {
  const wrong = {
    layers: [skin, null, 'fat', { tissue: 5, thickness_m: 'NaN', puncture: 7 }],
    targets: {},
    hazards: null,
    limb: { plane: [] },
    effects: ['CUTTING', null],
    name: 12,
    needle: true,
  };
  const { shown: seen, faults } = shownOf(wrong, kProfileShape);
  assert.deepEqual(seen, {
    layers: [skin, {}, {}, { tissue: undefined, thickness_m: undefined, puncture: {} }],
    targets: [],
    hazards: [],
    limb: { plane: {} },
    effects: ['CUTTING', undefined],
    name: undefined,
    needle: {},
  });
  assert.deepEqual(
    Object.fromEntries(faults.map((f) => [f.path, f.message])),
    {
      'layers[1]': 'must be an object, found null',
      'layers[2]': 'must be an object, found the text "fat"',
      'layers[3].tissue': 'must be a text, found the number 5',
      'layers[3].puncture': 'must be an object, found the number 7',
      targets: 'must be a list, found an object',
      hazards: 'must be a list, found null',
      'limb.plane': 'must be an object, found a list',
      'effects[1]': 'must be a text, found null',
      name: 'must be a text, found the number 12',
      needle: 'must be an object, found true',
    },
    'a number that is none is left to its field',
  );
  assert.ok(faults.every((f) => f.severity === 'ERROR'));
  assert.deepEqual(
    layerBounds(seen).map((l) => [l.name, l.to_m]),
    [
      ['skin', 0.003],
      ['layer 2', 0.003],
      ['layer 3', 0.003],
      ['layer 4', 0.003],
    ],
  );
});

test('the shapes have the names and types of profile.proto, and name what is wrong as its reader does', () => {
  const check = (shape, type, path) => {
    for (const [name, kind] of Object.entries(shape)) {
      const at = `${path}.${name}`,
        field = kTypes.messages[type][name];
      assert.ok(field, `${at}: ${type} has no such field`);
      assert.equal(Array.isArray(kind), field.repeated, `${at}: a list`);
      const of = Array.isArray(kind) ? kind[0] : kind;
      if (of === 'text') assert.ok(field.type === 'string' || field.type in kTypes.enums, `${at}: ${field.type}`);
      else if (of === 'flag') assert.equal(field.type, 'bool', at);
      else if (typeof of === 'string') assert.match(field.type, /^(double|u?int32)$/, at);
      else {
        assert.ok(field.type in kTypes.messages, `${at}: ${field.type}`);
        check(of, field.type, at);
      }
    }
  };
  check(kProfileShape, 'Profile', 'profile');
  check(kCourseShape, 'Curriculum', 'course');

  const wrongs = [5, 'x', true, null, [], {}, [null], [7], [{}]];
  const compare = (document, shape, type) => {
    const is_number = (f) => f.message.startsWith('must be a number');
    // which names an enum has is left to the server
    const brief = ({ path, message }) =>
      `${path}: ${message.replace(/^must be one of [A-Z_, ]+; /, 'must be a text, ')}`;
    assert.deepEqual(
      shownOf(document, shape).faults.map(brief).sort(),
      typeFaultsOf(document, type)
        .filter((f) => !is_number(f))
        .map(brief)
        .sort(),
      JSON.stringify(document),
    );
  };
  for (const wrong of wrongs) {
    for (const name of ['assigned_only', 'exam']) compare({ [name]: wrong }, kCourseShape, 'Curriculum');
    for (const name of Object.keys(kProfileShape)) compare({ [name]: wrong }, kProfileShape, 'Profile');
    for (const name of Object.keys(kProfileShape.layers[0]))
      compare({ layers: [skin, { [name]: wrong }] }, kProfileShape, 'Profile');
    for (const name of Object.keys(kCourseShape.exercises[0]))
      compare({ exercises: [{ [name]: wrong }] }, kCourseShape, 'Curriculum');
  }
});

test('lengths that cannot be drawn are left out', () => {
  const of = (thickness_m) => shownOf({ layers: [{ thickness_m }] }, kProfileShape).shown.layers[0].thickness_m;
  assert.deepEqual([0.003, -1000, 1000.5, 1e300, Infinity, NaN, '0.003', [1]].map(of), [
    0.003,
    -1000,
    ...Array(6).fill(undefined),
  ]);
});

test('the rules of a course hold for what is shown of any course', () => {
  const faultsOf = (course) => courseFaults(shownOf(course, kCourseShape).shown).map((f) => f.path);
  const course = (exercise) => ({ id: 'c', name: 'C', exercises: [exercise] });
  const knee = { id: 'a', name: 'A', profile_id: 'knee' };
  assert.deepEqual(faultsOf(course(knee)), []);
  assert.deepEqual(faultsOf({ id: 'c', name: 'C', exercises: 7 }), ['exercises']);
  assert.deepEqual(faultsOf(course(null)), ['exercises[0].id', 'exercises[0].name', 'exercises[0].profile_id']);
  assert.deepEqual(faultsOf({ ...course(knee), name: 5 }), ['name']);
  assert.deepEqual(faultsOf(course({ ...knee, prerequisites: [null, 5] })), []);
  assert.deepEqual(faultsOf(course({ ...knee, requirements: [null] })), [
    'exercises[0].requirements[0].measure',
    'exercises[0].requirements[0].min',
  ]);
  assert.ok(faultsOf(course({ ...knee, plan: [] })).includes('exercises[0].plan.frame'));
});

test('an exercise goes, or gets another id, among exercises of any type', () => {
  const a = { id: 'a' },
    b = { id: 'b', prerequisites: ['a', null] },
    odd = { id: 'c', prerequisites: 'a' };
  assert.deepEqual(withoutExercise([a, null, b, odd], 0), [null, { id: 'b', prerequisites: [null] }, odd]);
  assert.deepEqual(withoutExercise([a, null, b], 1), [a, b]);
  assert.deepEqual(withExerciseId([a, null, b, odd], 0, 'x'), [
    { id: 'x' },
    null,
    { ...b, prerequisites: ['x', null] },
    odd,
  ]);
  // an id that is typed again is empty for a moment: the others follow it there and back
  const empty = withExerciseId([a, b], 0, '');
  assert.deepEqual(withExerciseId(empty, 0, 'z')[1].prerequisites, ['z', null]);
});

test('a plan that is none becomes one when its line is chosen', () => {
  for (const plan of [null, [], 5, 'here'])
    assert.deepEqual(planGivenBy(plan, 'direction'), { direction: { x: 0, y: 0, z: -1 } });
});

test('what cannot hold a field gives way to an object or a list', () => {
  assert.deepEqual(withValue({ needle: 5 }, 'needle.gauge', 22), { needle: { gauge: 22 } });
  assert.deepEqual(withValue({ needle: 'abc' }, 'needle.gauge', 22), { needle: { gauge: 22 } });
  assert.deepEqual(withValue({ plan: [] }, 'plan.frame', 'LIMB'), { plan: { frame: 'LIMB' } });
  assert.deepEqual(withValue({ layers: {} }, 'layers[0].name', 'fat'), { layers: [{ name: 'fat' }] });
  assert.deepEqual(withValue({ layers: [null, skin] }, 'layers[0].name', 'fat'), { layers: [{ name: 'fat' }, skin] });
});

test('a name is put in or taken out of a list, and what is not known stays', () => {
  const known = ['A', 'B', 'C'];
  assert.deepEqual(toggled(known, ['C', 'LATER', null], 'A', true), ['A', 'C', 'LATER', null]);
  assert.deepEqual(toggled(known, ['C', 'A'], 'C', false), ['A']);
  assert.deepEqual(toggled(known, ['LATER'], 'LATER', false), []);
});

test('a field shows a value that is not a number as it stands in the JSON, and does not take it for one', () => {
  assert.equal(shown(0.003, 1e-3), '3');
  assert.equal(shown(undefined, 1), '');
  assert.equal(shown(null, 1), '');
  for (const value of ['NaN', '5', true, {}, [5], '']) {
    assert.equal(shown(value, 1e-3), JSON.stringify(value));
    assert.equal(typed(shown(value, 1e-3), 1e-3), null);
  }
});

test('dates that a field for dates cannot show, and lengths that are none', () => {
  for (const value of [undefined, 0, NaN, 1e300, -1e300, 9e14]) assert.equal(toInput(value), '');
  assert.match(toInput(Date.UTC(2261, 0, 1)), /^22(60|61)-\d\d-\d\dT\d\d:\d\d$/);
  assert.equal(clock(65.3), '1:05.3');
  for (const value of [NaN, Infinity, undefined, null]) assert.equal(clock(value), '–');
});

test('one is one, all else are many', () => {
  assert.deepEqual(
    [0, 1, 2].map((n) => counted(n, 'session')),
    ['0 sessions', '1 session', '2 sessions'],
  );
  assert.equal(counted(3, 'entry', 'entries'), '3 entries');
  assert.equal(newest(1, false, 'session'), '1 session, newest first');
  assert.equal(newest(25, true, 'entry', 'entries'), 'The newest 25 entries', 'of more');
});

const kinds = [
  { name: 'entries', unit: '', words: 'Entries' },
  { name: 'peak_force_layer_K_n', unit: 'N', words: 'Peak force in layer K' },
];

test('a tissue that the tip never was in has no row of its peak force, unless it is required', () => {
  const row = { measure: 'peak_force_layer_2_n', value: 0 };
  assert.equal(isOfTissueNotMet(row), true);
  for (const met of [{ value: 0.3 }, { passed: true }, { measure: 'peak_force_n' }])
    assert.equal(isOfTissueNotMet({ ...row, ...met }), false);
});

test('a measure of a layer is called by the name of the layer, as common/scoring measureWords calls it', () => {
  const words = (name, layers) => measureNamed(kinds, name, layers)?.words;
  assert.equal(words('peak_force_layer_2_n', ['skin', 'dura']), 'Peak force in dura');
  assert.equal(words('peak_force_layer_2_n', ['skin', '$& K']), 'Peak force in $& K', 'as it is');
  assert.equal(words('peak_force_layer_13_n', ['skin', 'dura']), 'Peak force in layer 13', 'the patient has two');
  assert.equal(words('entries', ['skin']), 'Entries');
  for (const name of [
    'peak_force_layer_K_n',
    'peak_force_layer_0_n',
    'peak_force_layer_01_n',
    'peak_force_layer__n',
    'no_such',
    undefined,
  ])
    assert.equal(measureNamed(kinds, name, ['skin']), undefined, name);
  assert.equal(measureNamed(kinds, 'peak_force_layer_1_n', []).unit, 'N');
});

test('an exercise can ask for a measure of each layer of its patient, and for none with a K', () => {
  assert.deepEqual(measuresOf(kinds, ['skin', 'dura']), [
    kinds[0],
    { name: 'peak_force_layer_1_n', unit: 'N', words: 'Peak force in skin' },
    { name: 'peak_force_layer_2_n', unit: 'N', words: 'Peak force in dura' },
  ]);
  assert.deepEqual(measuresOf(kinds, []), [kinds[0]]);
});

// The mock's check of a document: by the proto, not by the console's own code.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { kTypes } from './mock/document_types.mjs';
import { courseProblemsOf, problemsOf } from './mock/profiles.mjs';

test('the proto is read with nested messages, enums, lists and choices', () => {
  const { messages, enums } = kTypes;
  assert.deepEqual(
    ['layers', 'axial_model', 'needle', 'sources'].map((name) => [
      messages.Profile[name].type,
      messages.Profile[name].repeated,
    ]),
    [
      ['Layer', true],
      ['Profile.AxialModel', false],
      ['Needle', false],
      ['string', false],
    ],
  );
  assert.equal(messages.Limb.sphere.type, 'Limb.Sphere', 'of a oneof');
  assert.equal(messages['Limb.Sphere'].center_m.type, 'Vector3');
  assert.equal(messages.Fem.layers.type, 'Fem.Layer', 'not the Layer outside');
  assert.equal(messages['Exercise.Plan'].frame.type, 'Exercise.Plan.Frame');
  assert.deepEqual(enums['Needle.Tip'], ['HYPODERMIC', 'QUINCKE', 'TUOHY', 'PENCIL_POINT']);
});

test('every value of a wrong type is a fault of its own, before anything else is judged', () => {
  const faultsOf = (problems) => Object.fromEntries(problems.map((p) => [p.path, p.message]));
  const profile = { layers: [{ thickness_m: 'NaN', tissue: 5 }, null], fem: 7, needle: { gauge: [] } };
  assert.deepEqual(faultsOf(problemsOf(profile)), {
    'needle.gauge': 'must be a number, found a list',
    'layers[0].tissue':
      'must be one of SKIN, FAT, MUSCLE, BURSA, CAPSULE, TENDON, CARTILAGE, BONE, OTHER; found the number 5',
    'layers[0].thickness_m': 'must be a number, found the text "NaN"',
    'layers[1]': 'must be an object, found null',
    fem: 'must be an object, found the number 7',
  });
  const course = { exercises: [{ requirements: [{ min: 'one' }], aids: { allowed: 5 } }] };
  assert.deepEqual(faultsOf(courseProblemsOf(course)), {
    'exercises[0].requirements[0].min': 'must be a number, found the text "one"',
    'exercises[0].aids.allowed': 'must be a list, found the number 5',
  });
});

// Recordings in a body: what a sample's structure is called, its colour, and when the needle is in one.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { measuresOf } from '../../client/web/app/lib/measures.js';
import { contactsOf } from '../../client/web/app/lib/recording.js';
import {
  hazardKindOf,
  kTissues,
  layerColors,
  layerNames,
  profileLayers,
  structureColors,
  tissueColor,
  tissueOf,
} from '../../client/web/app/lib/tissue.js';
import { kKinds, kMuscleColors } from '../../client/web/app/profile/kinds.js';
import { kTypes } from './mock/document_types.mjs';
import { kVolumes, lumbar } from './support/volumes.mjs';

const indexOf = (profile, id) => profile.volume.structures.findIndex((s) => s.id === id);
const kBody = {
  volume: {
    structures: [
      { id: 'skin', layer: { tissue: 'SKIN' } },
      { id: 'nerve', layer: { tissue: 'OTHER', name: 'ulnar nerve' } },
      { id: 'ulna', layer: { tissue: 'BONE' } },
    ],
  },
};

test('a structure has the colour of its kind, whatever its name', () => {
  assert.deepEqual(kTissues, kTypes.enums['Layer.Tissue']);
  assert.deepEqual(
    kKinds.map(({ name }) => name),
    kTypes.enums['Volume.Structure.Kind'],
  );
  for (const { tissue, hazard } of kKinds) {
    assert.ok(kTissues.includes(tissue), tissue);
    assert.ok(kTypes.enums['Hazard.Kind'].includes(hazard), hazard);
  }
  const colorOf = (structure) => structureColors([structure])[0],
    color = (kind) => kKinds.find(({ name }) => name === kind).color;
  assert.equal(colorOf({ kind: 'NERVE', tissue: 'OTHER', name: 'fluid' }), color('NERVE'));
  assert.equal(colorOf({ tissue: 'OTHER', name: 'ulnar nerve' }), color('OTHER'), 'without a kind: its tissue');
  assert.equal(colorOf({ id: 'a', layer: { tissue: 'TENDON' } }), color('TENDON'));
  assert.deepEqual(
    structureColors(Array.from({ length: 6 }, () => ({ kind: 'MUSCLE' }))),
    [...kMuscleColors, kMuscleColors[0]],
    'muscles in turn',
  );
  const nerve = { volume: { structures: [{ id: 'n', kind: 'NERVE', layer: {} }] } };
  assert.equal(hazardKindOf(nerve, { name: 'n', structure: 'n' }), 'NERVE');
  assert.equal(hazardKindOf(nerve, { name: 'n', structure: 'n', kind: 'OTHER' }), 'OTHER');
  assert.equal(hazardKindOf(kBody, { name: 'n', structure: 'ulna' }), 'BONE');
  assert.equal(tissueOf({ kind: 'DISC', layer: {} }), 'CARTILAGE');
});

test('a sample of a body names the structure with its number', () => {
  assert.equal(kVolumes.length, 12);
  for (const profile of kVolumes) {
    const { structures } = profile.volume;
    assert.deepEqual(
      layerNames(profile),
      structures.map((s) => s.layer.name),
    );
    assert.deepEqual(
      profileLayers(profile),
      structures.map((s) => s.layer),
    );
    assert.deepEqual(layerColors(profile), structureColors(structures));
  }
  const kinds = [{ name: 'peak_force_layer_K_n', unit: 'N', words: 'Peak force in layer K' }];
  const flavum = measuresOf(kinds, layerNames(lumbar))[indexOf(lumbar, 'flavum')];
  assert.deepEqual([flavum.name, flavum.words], ['peak_force_layer_7_n', 'Peak force in ligamentum flavum']);
  // shells: as before, by tissue alone
  assert.deepEqual(layerColors({ layers: [{ tissue: 'SKIN' }, { tissue: 'OTHER', name: 'nerve' }, null] }), [
    tissueColor('SKIN'),
    tissueColor('OTHER'),
    tissueColor('OTHER'),
  ]);
});

const momentsOf = (moments, profile) => {
  const columns = { t_s: [], layer: [], insertion_m: [] };
  for (const [t, layer, insertion_m] of moments) {
    columns.t_s.push(t);
    columns.layer.push(layer);
    columns.insertion_m.push(insertion_m);
  }
  return Object.fromEntries(contactsOf(columns, profile).map((c) => [c.measure, c.moments_s]));
};

test('the tip touches bone in a structure of bone, or one that is a hazard of bone', () => {
  const moments = [
    [0, -1, 0],
    [1, 0, 0.01],
    [2, 2, 0.02],
    [3, 0, 0.01],
    [4, 1, 0.02],
    [5, -1, 0],
  ];
  assert.deepEqual(momentsOf(moments, kBody).bone_contacts, [2]);
  const hazards = [{ name: 'sesamoid', kind: 'BONE', structure: 'nerve' }];
  const { bone_contacts, hazards_touched } = momentsOf(moments, { ...kBody, hazards });
  assert.deepEqual([bone_contacts, hazards_touched], [[2, 4], []]);
});

test('a structure is touched until the shaft is drawn back out of it', () => {
  const profile = { ...kBody, hazards: [{ name: 'ulnar nerve', kind: 'NERVE', structure: 'nerve' }] };
  const touched = (moments) => momentsOf(moments, profile).hazards_touched;
  assert.deepEqual(
    touched([
      [0, -1, 0],
      [1, 0, 0.01],
      [2, 1, 0.02], // into the nerve
      [3, 0, 0.03], // the tip is through, the shaft is not
      [4, 1, 0.021], // still the same touch
      [5, 0, 0.019], // drawn back out of it
      [6, 0, 0.022], // as deep as before, but past it
      [7, 1, 0.022],
      [8, -1, 0],
      [9, 0, 0.03], // another way in, past it
    ]),
    [2, 7],
  );
  assert.deepEqual(touched([[0, -1, 0]]), []);
  // every patient of the lessons: in at each hazard's structure once
  for (const sample of kVolumes) {
    const first = sample.hazards.find((h) => h.kind !== 'BONE');
    const path = [
      [0, -1, 0],
      [1, 0, 0.01],
      [2, indexOf(sample, first.structure), 0.02],
    ];
    assert.deepEqual(momentsOf(path, sample).hazards_touched, [2], sample.id);
  }
});

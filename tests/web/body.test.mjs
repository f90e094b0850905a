// A body's cut: areas and places from the server's runs.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { areasOf, inSection, structureColor } from '../../client/web/app/lib/body.js';

// three rows of four points, from bottom to top: all of B; A A B B; outside, A, outside
const kSection = {
  corner_m: [0.1, 0.2, 0.3],
  across: [0, 1, 0],
  upward: [0, 0, 1],
  point_m: 0.001,
  columns: 4,
  rows: 3,
  structures: [
    { name: 'skin', tissue: 'SKIN' },
    { name: 'ulnar nerve', tissue: 'OTHER' },
  ],
  runs: [2, 4, 1, 2, 2, 2, 0, 1, 1, 1, 0, 2],
};

test('the runs of a cut become one path a structure, rows upwards', () => {
  const [nerve, skin] = areasOf(kSection);
  assert.equal(nerve.name, 'ulnar nerve');
  assert.equal(nerve.index, 1);
  assert.equal(nerve.path, 'M0 2h4v1h-4zM2 1h2v1h-2z');
  assert.equal(nerve.points, 6);
  assert.deepEqual(nerve.at, { x: 2, y: 2.5 });
  assert.equal(skin.path, 'M0 1h2v1h-2zM1 0h1v1h-1z');
  assert.deepEqual(skin.at, { x: 1, y: 1.5 });
});

test('a place of the profile lies in the cut by its distances from the corner', () => {
  const at = inSection(kSection, { x: 0.105, y: 0.202, z: 0.301 });
  assert.ok(Math.abs(at.x - 2) < 1e-9 && Math.abs(at.y - 2) < 1e-9 && Math.abs(at.off - 5) < 1e-9);
});

test('nerves and vessels have their own colour, other structures their tissue’s', () => {
  const other = structureColor({ tissue: 'OTHER', name: 'fascia' });
  assert.notEqual(structureColor({ tissue: 'OTHER', name: 'ulnar nerve' }), other);
  assert.notEqual(structureColor({ tissue: 'OTHER', name: 'radial artery' }), other);
  assert.equal(
    structureColor({ tissue: 'BONE', name: 'bone beside a nerve' }),
    structureColor({ tissue: 'BONE', name: '' }),
  );
});

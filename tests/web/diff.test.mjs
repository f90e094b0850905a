import assert from 'node:assert/strict';
import { test } from 'node:test';
import { changes, merge, resolved, same } from '../../client/web/app/lib/diff.js';
import { valueAt, withValue } from '../../client/web/app/lib/paths.js';
import { random } from './mock/gesture.mjs';

const base = { name: 'Knee', needle: { length_m: 0.06 }, layers: [{ tissue: 'SKIN', thickness_m: 0.003 }, { tissue: 'FAT', thickness_m: 0.008 }], effects: ['CUTTING'] };

test('changes are named by the smallest place, as the server names fields', () => {
  const after = withValue(withValue(withValue(base, 'layers[1].thickness_m', 0.009), 'needle.gauge', 22), 'name', undefined);
  assert.deepEqual(changes(base, after), [
    { path: 'name', before: 'Knee', after: undefined },
    { path: 'needle.gauge', before: undefined, after: 22 },
    { path: 'layers[1].thickness_m', before: 0.008, after: 0.009 },
  ]);
  assert.deepEqual(changes(base, structuredClone(base)), []);
});

test('the order of keys is no change, the order of a list is one', () => {
  assert.ok(same({ a: 1, b: [1, 2] }, { b: [1, 2], a: 1 }));
  assert.ok(!same([1, 2], [2, 1]));
  assert.ok(!same({ a: undefined }, { b: undefined }));
});

test('two people who changed different fields both keep theirs', () => {
  const mine = withValue(base, 'layers[0].thickness_m', 0.004), theirs = withValue(base, 'layers[1].thickness_m', 0.01);
  const { merged, clashes, taken } = merge(base, mine, theirs);
  assert.deepEqual(clashes, []);
  assert.deepEqual(taken, [{ path: 'layers[1].thickness_m', before: 0.008, after: 0.01 }]);
  assert.equal(valueAt(merged, 'layers[0].thickness_m'), 0.004);
  assert.equal(valueAt(merged, 'layers[1].thickness_m'), 0.01);
});

test('the same field changed twice is a clash, and both values can be had', () => {
  const { merged, clashes } = merge(base, { ...base, name: 'mine' }, { ...base, name: 'theirs' });
  assert.deepEqual(clashes, [{ path: 'name', base: 'Knee', mine: 'mine', theirs: 'theirs' }]);
  assert.equal(resolved(merged, clashes, {}).name, 'mine');
  assert.equal(resolved(merged, clashes, { name: 'theirs' }).name, 'theirs');
});

test('a list that one side lengthened is taken whole; both: a clash of the lists', () => {
  const longer = { ...base, layers: [...base.layers, { tissue: 'BONE', thickness_m: 0.02 }] };
  assert.equal(merge(base, base, longer).merged.layers.length, 3);
  const other = withValue(base, 'layers[0].thickness_m', 0.005);
  const { clashes } = merge(base, longer, other);
  assert.deepEqual(clashes.map((c) => c.path), ['layers']);
});

test('a field that they took away and I did not touch goes; one that I changed is a clash', () => {
  const gone = withValue(base, 'needle', undefined);
  assert.equal('needle' in merge(base, base, gone).merged, false);
  assert.deepEqual(merge(base, withValue(base, 'needle.length_m', 0.05), gone).clashes.map((c) => c.path), ['needle']);
});

test('random edits: each value of the merged document comes from one of the two, and choosing all of one side gives that side where both changed', () => {
  const seed = Number(process.env.NEEDLELAB_SEED ?? 5), next = random(seed);
  const paths = ['name', 'needle.length_m', 'layers[0].tissue', 'layers[1].thickness_m', 'effects[0]'];
  const edit = (doc) => paths.reduce((d, path) => (next() < 0.5 ? withValue(d, path, `v${Math.floor(next() * 3)}`) : d), doc);
  for (let round = 0; round < 500; round++) {
    const mine = edit(base), theirs = edit(base);
    const { merged, clashes } = merge(base, mine, theirs);
    const all_theirs = resolved(merged, clashes, Object.fromEntries(clashes.map((c) => [c.path, 'theirs'])));
    for (const path of paths) {
      const [b, m, t] = [base, mine, theirs].map((d) => valueAt(d, path));
      const wanted = same(m, b) ? t : m;
      assert.deepEqual(valueAt(merged, path), wanted, `seed ${seed}, round ${round}, ${path}`);
      assert.deepEqual(valueAt(all_theirs, path), same(t, b) ? m : t, `seed ${seed}, round ${round}, ${path}`);
    }
  }
});

test('changing a place leaves the rest of the document shared, and undefined takes an item out of a list', () => {
  const next = withValue(base, 'layers[0].thickness_m', 1);
  assert.equal(next.layers[1], base.layers[1]);
  assert.equal(base.layers[0].thickness_m, 0.003);
  assert.deepEqual(withValue(base, 'layers[0]', undefined).layers.map((l) => l.tissue), ['FAT']);
  assert.deepEqual(withValue({}, 'limb.plane.point_m.x', 1), { limb: { plane: { point_m: { x: 1 } } } });
});

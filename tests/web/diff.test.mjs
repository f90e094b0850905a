import assert from 'node:assert/strict';
import { test } from 'node:test';
import { changes, merge, resolved, same } from '../../client/web/app/lib/diff.js';
import { valueAt, withValue } from '../../client/web/app/lib/paths.js';
import { random } from './mock/gesture.mjs';

const base = {
  name: 'Knee',
  needle: { length_m: 0.06 },
  layers: [
    { tissue: 'SKIN', thickness_m: 0.003 },
    { tissue: 'FAT', thickness_m: 0.008 },
  ],
  effects: ['CUTTING'],
};

test('changes are named by the smallest place, as the server names fields', () => {
  const after = withValue(
    withValue(withValue(base, 'layers[1].thickness_m', 0.009), 'needle.gauge', 22),
    'name',
    undefined,
  );
  assert.deepEqual(changes(base, after), [
    { path: 'name', before: 'Knee', after: undefined },
    { path: 'needle.gauge', before: undefined, after: 22 },
    { path: 'layers[1].thickness_m', before: 0.008, after: 0.009 },
  ]);
  assert.deepEqual(changes(base, structuredClone(base)), []);
});

test('the order of keys is not a change, the order of a list is one', () => {
  assert.ok(same({ a: 1, b: [1, 2] }, { b: [1, 2], a: 1 }));
  assert.ok(!same([1, 2], [2, 1]));
  assert.ok(!same({ a: undefined }, { b: undefined }));
});

test('two people who changed different fields both keep theirs', () => {
  const mine = withValue(base, 'layers[0].thickness_m', 0.004),
    theirs = withValue(base, 'layers[1].thickness_m', 0.01);
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

test('what one side added stays, and so does what the other changed', () => {
  const longer = { ...base, layers: [...base.layers, { tissue: 'BONE', thickness_m: 0.02 }] };
  assert.equal(merge(base, base, longer).merged.layers.length, 3);
  const other = withValue(base, 'layers[0].thickness_m', 0.005);
  for (const [mine, theirs] of [
    [longer, other],
    [other, longer],
  ]) {
    const { merged, clashes } = merge(base, mine, theirs);
    assert.deepEqual(clashes, []);
    assert.deepEqual(merged.layers, [{ tissue: 'SKIN', thickness_m: 0.005 }, base.layers[1], longer.layers[2]]);
  }
});

test('items that one side moved are followed by their names', () => {
  const course = { exercises: [{ id: 'a' }, { id: 'b', attempts: 3 }, { id: 'c' }] },
    [a, b, c] = course.exercises;
  const moved = { exercises: [b, a, c] },
    changed = { exercises: [{ ...a, attempts: 1 }, b, c] };
  for (const [mine, theirs] of [
    [moved, changed],
    [changed, moved],
  ]) {
    const { merged, clashes } = merge(course, mine, theirs);
    assert.deepEqual(clashes, []);
    assert.deepEqual(merged.exercises, [b, { id: 'a', attempts: 1 }, c]);
  }
  const clash = merge(course, { exercises: [b, { id: 'a', attempts: 2 }, c] }, changed).clashes;
  assert.deepEqual(clash, [{ path: 'exercises[1].attempts', base: undefined, mine: 2, theirs: 1 }]);
});

test('two orders, or a change of what the other took away, are a clash of the whole list', () => {
  const course = { exercises: [{ id: 'a' }, { id: 'b' }, { id: 'c' }] },
    [a, b, c] = course.exercises;
  for (const [mine, theirs] of [
    [
      [b, a, c],
      [a, c, b],
    ],
    [
      [{ id: 'a', attempts: 1 }, b, c],
      [b, c],
    ],
    [
      [b, c],
      [{ id: 'a', attempts: 1 }, b, c],
    ],
  ]) {
    const { merged, clashes } = merge(course, { exercises: mine }, { exercises: theirs });
    assert.deepEqual(clashes, [{ path: 'exercises', base: course.exercises, mine, theirs }]);
    assert.deepEqual(resolved(merged, clashes, { exercises: 'theirs' }).exercises, theirs);
  }
});

test('what both took away goes, what both added stands there once, a group keeps the members of both', () => {
  assert.deepEqual(merge({ m: ['x', 'y', 'z'] }, { m: ['y', 'z', 'new'] }, { m: ['x', 'y', 'two'] }), {
    merged: { m: ['y', 'new', 'two'] },
    taken: [
      { path: 'm[2]', before: 'z', after: undefined },
      { path: 'm[2]', before: undefined, after: 'two' },
    ],
    clashes: [],
  });
  assert.deepEqual(merge({ m: ['x'] }, { m: ['n'] }, { m: ['n'] }).merged, { m: ['n'] });
});

test('a place in space is one value, layers of one tissue are not mistaken for each other', () => {
  assert.deepEqual(
    merge({ p: [0, 0, 0] }, { p: [1, 0, 0] }, { p: [0, 2, 0] }).clashes.map((c) => c.path),
    ['p'],
  );
  const twice = {
      layers: [
        { tissue: 'OTHER', k: 1 },
        { tissue: 'OTHER', k: 2 },
      ],
    },
    [one, two] = twice.layers;
  const changed = { layers: [one, { ...two, k: 5 }] };
  assert.deepEqual(merge(twice, { layers: [{ ...one, k: 9 }, two] }, changed).merged.layers, [
    { tissue: 'OTHER', k: 9 },
    { tissue: 'OTHER', k: 5 },
  ]);
  assert.deepEqual(
    merge(twice, { layers: [one] }, changed).clashes.map((c) => c.path),
    ['layers'],
  );
});

test('a field that they took away and I did not touch goes; one that I changed is a clash', () => {
  const gone = withValue(base, 'needle', undefined);
  assert.equal('needle' in merge(base, base, gone).merged, false);
  assert.deepEqual(
    merge(base, withValue(base, 'needle.length_m', 0.05), gone).clashes.map((c) => c.path),
    ['needle'],
  );
});

test('random edits: each value of the merged document comes from one of the two, and choosing all of one side gives that side where both changed', () => {
  const seed = Number(process.env.NEEDLELAB_SEED ?? 5),
    next = random(seed);
  const paths = ['name', 'needle.length_m', 'needle.gauge', 'layers[0].thickness_m', 'layers[1].thickness_m'];
  const edit = (doc) =>
    paths.reduce((d, path) => (next() < 0.5 ? withValue(d, path, `v${Math.floor(next() * 3)}`) : d), doc);
  for (let round = 0; round < 500; round++) {
    const mine = edit(base),
      theirs = edit(base);
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
  assert.deepEqual(
    withValue(base, 'layers[0]', undefined).layers.map((l) => l.tissue),
    ['FAT'],
  );
  assert.deepEqual(withValue({}, 'limb.plane.point_m.x', 1), { limb: { plane: { point_m: { x: 1 } } } });
});

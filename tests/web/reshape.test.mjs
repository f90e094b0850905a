// A body of another build, fat, size or side, and a hand on its planned line. What the engine finds in such bodies:
// console/shaping.mjs.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { fromSection, inSection } from '../../client/web/app/lib/body.js';
import {
  built,
  fatOf,
  fatter,
  fitOf,
  isWhole,
  mirrorAxis,
  mirrored,
  outline,
  reshaped,
  scaled,
  shifted,
  sideOf,
} from '../../client/web/app/lib/reshape.js';
import { triedOf } from '../../client/web/app/profile/try_it.js';
import { kVolumes, lumbar } from './support/volumes.mjs';

const kRegions = ['shoulder', 'knee', 'wrist', 'lumbar'];
const familyOf = (region) =>
  ['slender', 'median', 'heavy'].map((build) => kVolumes.find(({ id }) => id === `${region}-${build}`));
const knee = familyOf('knee')[1];
const kMedian = { build: 0, size: 1, mirrored: '' };

/** All numbers of a document with their paths. */
const numbersOf = (value, path = '') =>
  typeof value === 'number'
    ? [[path, value]]
    : value && typeof value === 'object'
      ? Object.entries(value).flatMap(([key, item]) => numbersOf(item, `${path}.${key}`))
      : [];
const near = (a, b, off, what) => assert.ok(Math.abs(a - b) <= off, `${what}: ${a} is not ${b}`);

test('another size scales what is in metres, and nothing else', () => {
  for (const body of kVolumes) {
    const made = new Map(numbersOf(scaled(body, 1.1)));
    for (const [path, value] of numbersOf(body)) {
      const name = path.split('.').findLast((step) => !/^([xyz]|\d+)$/.test(step));
      const is_length = /^\.(volume|targets|hazards)/.test(path) && /(?<!_per)_m$/.test(name);
      near(made.get(path), is_length ? 1.1 * value : value, 1e-9, `${body.id}${path}`);
    }
  }
});

test('the other side: places lie as far apart, left is right, and the other side of it is the same body', () => {
  for (const body of kVolumes) {
    const other = mirrored(body);
    assert.equal(JSON.stringify(mirrored(other)), JSON.stringify(body), body.id);
    assert.notEqual(JSON.stringify(other.volume), JSON.stringify(body.volume));
    const [before, after] = [numbersOf(body), numbersOf(other)],
      changed = before.filter(([, value], i) => after[i][1] !== value),
      axis = changed[0][0].at(-1);
    assert.ok(
      changed.every(([path]) => path.endsWith(`.${axis}`) && !/radii_m/.test(path)),
      body.id,
    );
    assert.ok(
      after.every(([, value], i) => Math.abs(value) === Math.abs(before[i][1])),
      body.id,
    );
  }
  assert.equal(sideOf(knee), 'right');
  assert.equal(sideOf(mirrored(knee)), 'left');
  assert.deepEqual(
    [mirrored(knee).directions.plus_y, mirrored(knee).directions.plus_x],
    ['to the back', 'down the leg'],
  );
  // of the lumbar spine both the axis and the words turn: its patient's right stays on the right
  assert.deepEqual(mirrored(lumbar).directions, lumbar.directions);
  assert.equal(mirrored(lumbar).description, lumbar.description);
});

test('builds: from slender to heavy is the heavy body, halfway the mean of all lengths and forces', () => {
  for (const region of kRegions) {
    const family = familyOf(region),
      [slender, median, heavy] = family;
    const made = built(slender, family, { ...kMedian, build: -1 }, 1);
    assert.deepEqual(made.volume, heavy.volume, region);
    assert.deepEqual([made.targets, made.needle], [heavy.targets, heavy.needle], region);
    const between = new Map(numbersOf(built(median, family, kMedian, 0.5).volume)),
      ends = new Map(numbersOf(heavy.volume));
    for (const [path, value] of numbersOf(median.volume))
      near(between.get(path), (value + ends.get(path)) / 2, 1e-9, `${region}${path}`);
    // what the author changed stays changed, in a body of another size and side, too
    const own = { ...scaled(mirrored(median), 1.2), needle: { length_m: 0.07 } };
    own.volume.structures[0].layer.cutting_force_n += 0.25;
    const is = { build: 0, size: 1.2, mirrored: mirrorAxis(median) },
      back = built(built(own, family, is, 0.7), family, { ...is, build: 0.7 }, 0);
    const again = numbersOf(back);
    numbersOf(own).forEach(([path, value], i) => near(again[i][1], value, 3e-9, `${region}${path}`));
    const to_heavy = built(own, family, is, 1);
    near(
      to_heavy.volume.structures[0].layer.cutting_force_n - heavy.volume.structures[0].layer.cutting_force_n,
      0.25,
      1e-9,
      region,
    );
    assert.deepEqual(to_heavy.needle, { length_m: 0.07 });
  }
});

test('a body is found in its family whatever its size, side, fat and place', () => {
  for (const region of kRegions) {
    const family = familyOf(region);
    for (const build of [-1, -0.3, 0, 0.62, 1]) {
      const to = { build, size: 0.9, mirrored: mirrorAxis(family[1]), fat_m: 0.004 };
      const made = reshaped({ doc: family[1], at: kMedian, up: { x: 0, y: 0, z: 1 } }, to, family);
      const found = fitOf(shifted(made, { x: 0.01, y: 0.002, z: -0.003 }), family);
      near(found.build, build, 0.08, `${region} ${build}`);
      near(found.size, 0.9, 0.01, region);
      assert.equal(found.mirrored, mirrorAxis(family[1]));
    }
    for (const other of kRegions.filter((one) => one !== region))
      assert.notEqual(outline(familyOf(other)[0]), outline(family[0]));
    const squashed = structuredClone(family[1]);
    for (const { parts } of squashed.volume.groups) for (const { capsule } of parts) if (capsule) capsule.a_m.x += 0.1;
    assert.equal(fitOf(squashed, family), null, 'too far from all of them');
  }
});

test('more fat: the skin moves out, the rules under the fat go deeper, and the deep parts stay together', () => {
  for (const body of kVolumes) {
    const up = { x: 0, y: 0.6, z: 0.8 },
      more = fatter(body, 0.005, up);
    near(fatOf(more), fatOf(body) + 0.005, 1e-9, body.id);
    const { volume } = body;
    volume.groups.forEach(({ id, parts }, g) => {
      const made = more.volume.groups[g].parts;
      parts.forEach((part, i) => {
        const after = numbersOf(made[i]);
        numbersOf(part).forEach(([path, value], k) => {
          const now = after[k][1],
            axis = path.at(-1);
          if (/(at|a|b|point|center)_m\.[xyz]$/.test(path)) near(now, value - 0.005 * up[axis], 1e-9, `${id}${path}`);
          else near(now, value + (id === volume.skin && /radi/.test(path) ? 0.005 : 0), 1e-9, `${id}${path}`);
        });
      });
    });
    const tops = ({ volume: { rules } }, of) =>
      rules.find(({ structure, group }) => structure === of && group === volume.skin);
    assert.equal(tops(more, 'skin').from_m, tops(body, 'skin').from_m);
    near(more.targets[0].center_m.z, body.targets[0].center_m.z - 0.004, 1e-9, body.id);
  }
  // a toe keeps some of its radius
  const least = fatter(knee, -0.006, { x: 0, y: 0, z: 1 }).volume.groups.find(({ id }) => id === 'skin');
  assert.ok(numbersOf(least).every(([path, value]) => !/radi/.test(path) || value > 0.003));
  assert.equal(fatOf({ volume: { ...knee.volume, rules: [] } }), undefined, 'a body without such a rule');
  for (const volume of [
    undefined,
    5,
    {},
    { groups: [5], structures: [], rules: [] },
    { groups: [{}], structures: [], rules: [] },
  ])
    assert.equal(isWhole({ volume }), false);
  assert.ok(isWhole(knee));
});

test('a place of the cut is where the pointer is: the inverse of what is drawn', () => {
  const section = { corner_m: [0.1, -0.2, 0.3], across: [0.6, 0.8, 0], upward: [0, 0, 1], point_m: 0.001, rows: 40 };
  const p = { x: 0.11, y: -0.17, z: 0.31 };
  const back = fromSection(section, inSection(section, p));
  for (const axis of ['x', 'y', 'z']) near(back[axis], p[axis], 1e-12, axis);
});

test('what the hand met is judged up to the target', () => {
  const plan = {
    entry_m: { x: 0, y: 0, z: 0 },
    target_m: { x: 0, y: 0, z: -0.02 },
    length_m: 0.02,
    direction: [0, 0, -1],
  };
  const preview = {
    depth_m: [0, 0.01, 0.02, 0.03],
    total_n: [0, 1.5, 0.5, 9],
    layers: [
      { name: 'skin', tissue: 'SKIN', from_m: 0, to_m: 0.015 },
      { name: 'space', tissue: 'OTHER', from_m: 0.015, to_m: 0.025 },
      { name: 'bone', tissue: 'BONE', from_m: 0.025, to_m: 0.04 },
    ],
  };
  const structures = ['skin', 'space', 'bone'].map((id) => ({ id, layer: { name: id } }));
  const profile = {
    volume: { structures },
    needle: { length_m: 0.05 },
    targets: [{ name: 't', structure: 'space', center_m: plan.target_m }],
    hazards: [
      { name: 'beside', kind: 'NERVE', center_m: { x: 0.003, y: 0, z: -0.01 }, radius_m: 0.002 },
      {
        name: 'on the way',
        kind: 'NERVE',
        a_m: { x: 0, y: -0.01, z: -0.01 },
        b_m: { x: 0, y: 0.01, z: -0.01 },
        radius_m: 0.001,
      },
      { name: 'behind', structure: 'bone' },
    ],
  };
  const { values, hazards, too_short_m } = triedOf(profile, preview, plan);
  assert.deepEqual(values, {
    peak_force_n: 1.5,
    target_reached: 1,
    hazards_touched: 1,
    bone_contacts: 0,
    greatest_depth_m: 0.02,
    entries: 1,
  });
  assert.deepEqual([hazards.map(({ name }) => name), too_short_m], [['on the way'], 0]);
  const short = triedOf({ ...profile, needle: { length_m: 0.012 } }, preview, plan);
  near(short.too_short_m, 0.008, 1e-12, 'too short');
  assert.equal(short.values.target_reached, 0);
});

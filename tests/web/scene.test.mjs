import assert from 'node:assert/strict';
import { test } from 'node:test';
import { contactsOf, contactWords, forceOf, intoLimb, layerSpans, wayOf } from '../../client/web/app/lib/recording.js';
import {
  axisOf,
  clearLabels,
  cross,
  depthOf,
  dot,
  frameOf,
  inFrame,
  layerBounds,
  layerLabels,
  length,
  levelLine,
  offPlane,
  offPlaneLabel,
  offPlaneOpacity,
  offsetUnder,
  placed,
  spread,
} from '../../client/web/app/lib/scene.js';
import {
  courseFaults,
  planGivenBy,
  freshId,
  isDone,
  nextDue,
  numbered,
  withoutExam,
  withoutExercise,
} from '../../client/web/app/lib/course_rules.js';

import { followLayerNames } from '../../client/web/app/lib/tissue.js';

const near = (a, b, limit = 1e-9) => assert.ok(Math.abs(a - b) <= limit, `${a} is not ${b}`);
const v = (x, y, z) => ({ x, y, z });
const plane = { plane: { point_m: v(0, 0, 0.01), normal: v(0, 0, 2) } };
const ball = { sphere: { center_m: v(0, 0, -0.06), radius_m: 0.06 } };
const rod = { capsule: { a_m: v(-0.1, 0, -0.04), b_m: v(0.1, 0, -0.04), radius_m: 0.04 } };

test('depth under the skin of each kind of limb', () => {
  near(depthOf(plane)(v(5, 5, 0)), 0.01);
  near(depthOf(plane)(v(0, 0, 0.03)), -0.02);
  near(depthOf(ball)(v(0, 0, -0.02)), 0.02);
  near(depthOf(ball)(v(0.06, 0, -0.06)), 0);
  near(depthOf(rod)(v(0.05, 0, -0.03)), 0.03);
  near(depthOf(rod)(v(0.2, 0, -0.04)), -0.06);
  assert.ok(Number.isNaN(depthOf(undefined)(v(0, 0, 0))));
});

test('an anchored target or hazard moves with its layer along the normal, one without an anchor stays', () => {
  const layers = [
    { tissue: 'FAT', thickness_m: 0.02 },
    { tissue: 'BURSA', thickness_m: 0.002 },
  ];
  for (const limb of [plane, ball, rod]) {
    const target = { name: 't', center_m: v(0, 0.004, -0.01), anchor: { layer: 'bursa', offset_m: 0.001 } };
    const nerve = {
      name: 'n',
      a_m: v(0, -0.01, -0.01),
      b_m: v(0, 0.02, -0.01),
      anchor: { layer: 'bursa', offset_m: 0 },
    };
    const profile = { limb, layers, targets: [target, { name: 'free', center_m: v(0, 0, -0.01) }], hazards: [nerve] };
    const { targets, hazards } = placed(profile);
    near(depthOf(limb)(targets[0].center_m), 0.021);
    assert.deepEqual(targets[1].center_m, v(0, 0, -0.01));
    const { a_m, b_m } = hazards[0];
    near(depthOf(limb)(v((a_m.x + b_m.x) / 2, (a_m.y + b_m.y) / 2, (a_m.z + b_m.z) / 2)), 0.02);
    near(b_m.y - a_m.y, 0.03);
    near(offsetUnder(profile, targets[0], 'bursa'), 0.001);
    assert.equal(
      placed({ ...profile, targets: [{ ...target, anchor: { layer: 'dura', offset_m: 0 } }] }).targets[0].anchor.layer,
      'dura',
    );
  }
});

test('targets and hazards follow when a layer gets another name, and not when layers change places', () => {
  const layers = [{ tissue: 'SKIN' }, { tissue: 'BURSA' }, { tissue: 'BONE' }];
  const profile = {
    layers,
    targets: [{ name: 't', tissues: ['bursa', 'skin'], anchor: { layer: 'bursa', offset_m: 0 } }],
    hazards: [{ name: 'head', anchor: { layer: 'bone', offset_m: 0.02 } }, { name: 'nerve' }],
  };
  const named = followLayerNames(profile, {
    ...profile,
    layers: [layers[0], layers[1], { ...layers[2], name: 'femur' }],
  });
  assert.equal(named.hazards[0].anchor.layer, 'femur');
  assert.deepEqual(named.hazards[1], { name: 'nerve' });
  assert.deepEqual(named.targets, profile.targets);
  const other = followLayerNames(profile, { ...profile, layers: [layers[0], { tissue: 'TENDON' }, layers[2]] });
  assert.deepEqual(other.targets[0].tissues, ['tendon', 'skin']);
  assert.equal(other.targets[0].anchor.layer, 'tendon');
  const turned = { ...profile, layers: [layers[1], layers[0], layers[2]] };
  assert.equal(followLayerNames(profile, turned), turned);
  const fewer = { ...profile, layers: layers.slice(0, 2) };
  assert.equal(followLayerNames(profile, fewer), fewer);
});

test('the frame stands on the skin, square and right-handed, also for a slanted limb', () => {
  const limbs = [
    plane,
    ball,
    rod,
    { plane: { point_m: v(0.01, 0.02, 0.03), normal: v(1, 1, 1) } },
    { sphere: { center_m: v(0, 0, 0), radius_m: 0.05 } },
    { plane: { point_m: v(0, 0, 0), normal: v(1, 0, 0) } },
  ];
  for (const limb of limbs) {
    const { o, n, e1, e2 } = frameOf(limb);
    near(depthOf(limb)(o), 0);
    for (const axis of [n, e1, e2]) near(length(axis), 1);
    near(dot(n, e1), 0);
    near(dot(n, e2), 0);
    near(dot(e1, e2), 0);
    const below = { x: o.x - 0.004 * n.x, y: o.y - 0.004 * n.y, z: o.z - 0.004 * n.z };
    near(depthOf(limb)(below), 0.004);
    near(inFrame({ o, n, e1, e2 }, below).d, 0.004);
  }
});

test('a layer of a ball is drawn as a circle: d = R − √((R − level)² − u²)', () => {
  const frame = frameOf(ball),
    level = 0.01,
    line = levelLine(depthOf(ball), frame, level, { from_u: -0.03, to_u: 0.03, from_d: -0.01, to_d: 0.06 });
  assert.equal(line.length, 61);
  for (const p of line) near(p.d, 0.06 - Math.sqrt(0.05 ** 2 - p.u ** 2), 1e-6);
});

test('columns that the layer does not reach are left out', () => {
  const line = levelLine(depthOf(ball), frameOf(ball), 0.05, { from_u: -0.03, to_u: 0.03, from_d: -0.01, to_d: 0.06 });
  assert.ok(line.length > 10 && line.every((p) => Math.abs(p.u) <= 0.01 + 1e-9));
});

test('labels of a cut take the width of the longest, and a name is cut before its size', () => {
  const layers = layerBounds({
    layers: [
      { tissue: 'SKIN', thickness_m: 0.003 },
      { tissue: 'TENDON', name: 'interspinous ligament', thickness_m: 0.025 },
    ],
  });
  const plain = (texts) => texts.map((t) => t.replaceAll('\u00a0', ' '));
  const wide = layerLabels(layers, [0.4, null], 100, 1000);
  assert.deepEqual(plain(wide.texts), ['Skin 3 mm, φ 0.4 !', 'Interspinous ligament 25 mm']);
  near(wide.width_px, 24 + 27 * 7.5);
  near(layerLabels(layers, undefined, 300, 1000).width_px, 300);
  const narrow = layerLabels(layers, [0.4, null], 100, 24 + 18 * 7.5);
  assert.deepEqual(plain(narrow.texts), ['Skin 3 mm, φ 0.4 !', 'Interspinou… 25 mm']);
  for (const text of narrow.texts) assert.ok(text.length <= 18);
  assert.deepEqual(layerLabels([], undefined, 185, 320), { texts: [], width_px: 185 });
  // no thickness, or none that is a number
  assert.deepEqual(layerLabels([{ name: 'fat', from_m: 0.25, to_m: 0.25 }], [null], 100, 1000).texts, ['Fat –']);
});

test('labels stand clear of each other: at their wish, or below those that they would cover', () => {
  const at = (x, y, width = 100) => ({ x, y, width });
  assert.deepEqual(clearLabels([], 13), []);
  assert.deepEqual(clearLabels([at(0, 50), at(100, 52), at(0, 63)], 13), [50, 52, 63], 'beside and below, just clear');
  assert.deepEqual(clearLabels([at(0, 54), at(99, 50)], 13), [63, 50]);
  // the third goes below the second, which went below the first
  assert.deepEqual(clearLabels([at(0, 50), at(10, 58), at(20, 59)], 13), [50, 63, 76]);
  assert.deepEqual(clearLabels([at(0, 50), at(0, 50), at(0, 50)], 13), [50, 63, 76]);
});

test('labels are placed at any height, also where height + gap − height is less than the gap', () => {
  const y = 20.86195598618838;
  assert.ok(y + 13 - y < 13, 'a height that rounds down');
  const labels = (n, at_y) => Array.from({ length: n }, () => ({ x: 0, y: at_y, width: 100 }));
  assert.deepEqual(clearLabels(labels(2, y), 13), [y, y + 13]);
  assert.deepEqual(clearLabels(labels(3, y), 13), [y, y + 13, y + 13 + 13]);
  // so large that a gap is lost in it
  for (const huge of [1e300, Infinity]) assert.deepEqual(clearLabels(labels(3, huge), 13), [huge, huge, huge]);
});

test('layers add up; a thickness that is not a number counts as none', () => {
  const bounds = layerBounds({
    layers: [{ tissue: 'SKIN', thickness_m: 0.25 }, { tissue: 'FAT', thickness_m: 'x' }, { thickness_m: 0.5 }],
  });
  assert.deepEqual(bounds, [
    { name: 'skin', tissue: 'SKIN', from_m: 0, to_m: 0.25 },
    { name: 'fat', tissue: 'FAT', from_m: 0.25, to_m: 0.25 },
    { name: 'layer 3', tissue: 'OTHER', from_m: 0.25, to_m: 0.75 },
  ]);
});

test('a shape is as far off the plane as its nearest point: behind it positive, in front negative', () => {
  near(offPlane(0.002, 0.01), 0.008);
  near(offPlane(0.002, -0.01), -0.008);
  near(offPlane(0.002, -0.0019), 0);
  near(offPlane(0.002, 0.03, 0.005), 0.003);
  near(offPlane(0.002, -0.03, 0.005), 0);
});

test('a shape off the plane fades: full within 1 mm, half for every 8 mm beyond, and says where it is', () => {
  for (const off_m of [0, 0.001, -0.001]) near(offPlaneOpacity(off_m), 1);
  for (const [off_m, opacity] of [
    [0.009, 0.5],
    [-0.009, 0.5],
    [0.017, 0.25],
    [0.005, Math.SQRT1_2],
  ])
    near(offPlaneOpacity(off_m), opacity);
  assert.equal(offPlaneLabel('nerve', 0.0009), 'nerve');
  assert.equal(offPlaneLabel('nerve', 0.0084), 'nerve, 8 mm behind');
  assert.equal(offPlaneLabel('nerve', -0.0078), 'nerve, 8 mm in front');
});

test('behind the side view is away from who looks at it: u to the right, d down, v into the picture', () => {
  const frame = frameOf(plane),
    // u × d, as to the right × down
    into = inFrame(frame, {
      x: frame.o.x + frame.e2.x,
      y: frame.o.y + frame.e2.y,
      z: frame.o.z + frame.e2.z,
    });
  near(into.v, 1);
  near(dot(cross(frame.e1, { x: -frame.n.x, y: -frame.n.y, z: -frame.n.z }), frame.e2), 1);
});

test('labels keep their distance and their order', () => {
  const at = spread([10, 11, 12, 95, 99], 10, 5, 100);
  assert.ok(
    at.every((y, i) => i === 0 || y - at[i - 1] >= 10 - 1e-9),
    String(at),
  );
  assert.ok(at[0] >= 5 && at.at(-1) <= 100);
});

test('the needle points along +z of its quaternion', () => {
  const identity = axisOf(0, 0, 0, 1),
    down = axisOf(1, 0, 0, 0),
    h = Math.SQRT1_2,
    along_x = axisOf(0, h, 0, h);
  for (const [a, b] of [
    [identity, v(0, 0, 1)],
    [down, v(0, 0, -1)],
    [along_x, v(1, 0, 0)],
  ])
    for (const k of ['x', 'y', 'z']) near(a[k], b[k]);
});

test('a placed limb: poses of the recording are taken back into its frame', () => {
  const h = Math.SQRT1_2,
    into = intoLimb([1, 2, 3, 0, 0, h, h]);
  const p = into(v(1, 3, 3)),
    direction = into(v(0, 1, 0), true);
  near(p.x, 1);
  near(p.y, 0);
  near(p.z, 0);
  near(direction.x, 1);
  near(direction.y, 0);
  assert.deepEqual(intoLimb([])(v(1, 2, 3)), v(1, 2, 3));
});

test('the side view holds the way in: a slanted straight insertion has no part across it', () => {
  const n = 50,
    columns = { t_s: [], px_m: [], py_m: [], pz_m: [], qx: [], qy: [], qz: [], qw: [] };
  // hub to tip = (sin a, sin a, -cos a·…): a needle that leans towards x = y
  const axis = v(0.3, 0.3, -Math.sqrt(1 - 0.18)),
    half = Math.acos(axis.z) / 2,
    side = length(v(-axis.y, axis.x, 0));
  for (let i = 0; i < n; i++) {
    const s = -0.01 + (i / n) * 0.04;
    columns.t_s.push(i / 100);
    columns.px_m.push(axis.x * s);
    columns.py_m.push(axis.y * s);
    columns.pz_m.push(axis.z * s);
    columns.qx.push((-axis.y / side) * Math.sin(half));
    columns.qy.push((axis.x / side) * Math.sin(half));
    columns.qz.push(0);
    columns.qw.push(Math.cos(half));
  }
  const way = wayOf(columns, { limb: { plane: { point_m: v(0, 0, 0), normal: v(0, 0, 1) } } }, []);
  for (const p of way.points) near(p.v, 0, 1e-12);
  for (const a of way.axes) near(a.v, 0, 1e-9);
  near(way.axes[0].d, -axis.z);
  near(way.deepest_m, -axis.z * (-0.01 + (49 / 50) * 0.04));
});

test('forces are magnitudes; spans of layers join without holes', () => {
  assert.deepEqual(forceOf({ fx_n: [3, 0], fy_n: [4, 0], fz_n: [0, -2] }), [5, 2]);
  assert.deepEqual(
    forceOf({ force_n: [7], fx_n: [3], fy_n: [4], fz_n: [0] }),
    [7],
    "the server's own comes first: extremes of components are not of one moment",
  );
  assert.deepEqual(layerSpans({ t_s: [0, 1, 2, 3, 4], layer: [-1, 0, 0, 1, -1] }), [
    { from: 1, to: 3, layer: 0 },
    { from: 3, to: 4, layer: 1 },
  ]);
  assert.deepEqual(layerSpans({}), []);
});

const course = {
  id: 'c',
  name: 'C',
  exercises: [
    { id: 'a', name: 'A', profile_id: 'p' },
    { id: 'b', name: 'B', profile_id: 'p', prerequisites: ['a'] },
  ],
};

test('a course is right, or says where it is not', () => {
  assert.deepEqual(courseFaults(course, { profiles: ['p'], measures: [] }), []);
  const paths = (c, known) => courseFaults(c, known).map((f) => f.path);
  // what must be passed first may stand further down; only a circle cannot be begun
  assert.deepEqual(paths({ ...course, exercises: [...course.exercises].reverse() }), []);
  const circle = {
    ...course,
    exercises: [
      { ...course.exercises[0], prerequisites: ['c'] },
      course.exercises[1],
      { id: 'c', name: 'C', profile_id: 'p', prerequisites: ['b'] },
    ],
  };
  assert.deepEqual(
    paths(circle),
    [0, 1, 2].map((i) => `exercises[${i}].prerequisites[0]`),
  );
  assert.deepEqual(
    paths({ ...course, exercises: [{ ...course.exercises[0], prerequisites: ['a'] }, course.exercises[1]] }),
    ['exercises[0].prerequisites[0]'],
  );
  assert.deepEqual(paths(course, { profiles: [] }), ['exercises[0].profile_id', 'exercises[1].profile_id']);
  assert.deepEqual(paths({ id: '', name: ' ', exercises: [] }), ['id', 'name', 'exercises']);
  assert.deepEqual(paths({ ...course, exam: true, results_from_unix_ms: 5 }), []);
  assert.deepEqual(paths({ ...course, assigned_only: true }), []);
  for (const exam of [{}, { exam: false }, { assigned_only: true }])
    assert.deepEqual(paths({ ...course, ...exam, results_from_unix_ms: 5 }), ['results_from_unix_ms']);
  assert.deepEqual(withoutExam({ ...course, exam: true, assigned_only: true, results_from_unix_ms: 5 }), {
    ...course,
    assigned_only: true,
  });
  const odd = {
    ...course,
    exercises: [
      {
        id: 'a',
        name: 'A',
        profile_id: 'p',
        attempts: 1.5,
        time_limit_s: 0,
        requirements: [{ measure: 'entries', min: 3, max: 2 }, { measure: '' }],
      },
      { ...course.exercises[0] },
    ],
  };
  assert.deepEqual(paths(odd, { measures: ['entries'] }), [
    'exercises[0].requirements[0].max',
    'exercises[0].requirements[1].measure',
    'exercises[0].requirements[1].min',
    'exercises[0].attempts',
    'exercises[0].time_limit_s',
    'exercises[1].id',
  ]);
});

test('a plan is a line, or says where it is not', () => {
  const good = { frame: 'LIMB', entry_m: { x: 0.01, y: 0, z: 0 }, direction: { x: 0, y: 0, z: -2 } };
  const faults = (plan, more = {}) =>
    courseFaults({ ...course, exercises: [{ ...course.exercises[0], plan, ...more }] }).map((f) =>
      f.path.replace('exercises[0].', ''),
    );
  const to = (target_m) => ({ frame: 'LIMB', entry_m: good.entry_m, target_m });
  assert.deepEqual(faults(good), []);
  assert.deepEqual(faults(undefined), []);
  assert.deepEqual(faults(to({ x: 0.01, y: 0, z: -0.03 })), []);
  assert.deepEqual(faults({ ...good, frame: 'W' }), ['plan.frame']);
  assert.deepEqual(faults({ ...good, entry_m: { x: NaN, y: 0 } }), ['plan.entry_m.x', 'plan.entry_m.z']);
  assert.deepEqual(faults({ ...good, entry_m: undefined }), ['plan.entry_m.x', 'plan.entry_m.y', 'plan.entry_m.z']);
  assert.deepEqual(faults({ ...good, direction: { x: 0, y: 0, z: 0 } }), ['plan.direction']);
  assert.deepEqual(faults({ ...good, direction: { x: 0, y: 0, z: -5e-7 } }), []);
  assert.deepEqual(faults({ ...good, direction: { x: 0, y: 0, z: Infinity } }), ['plan.direction.z']);
  assert.deepEqual(faults({ ...good, direction: undefined }), ['plan']);
  assert.deepEqual(faults({ ...good, target_m: { x: 0, y: 0, z: -0.03 } }), ['plan']);
  assert.deepEqual(faults(to({ ...good.entry_m })), ['plan.target_m']);
  assert.deepEqual(faults(to({ x: 0.01, y: 0, z: -5e-7 })), ['plan.target_m']);
  // only a plan makes its measures
  const requirements = [
    { measure: 'planned_entry_error_m', max: 0.003 },
    { measure: 'largest_planned_line_error_m', max: 0.003 },
    { measure: 'largest_lateral_error_m', max: 0.003 },
  ];
  assert.deepEqual(faults(good, { requirements }), []);
  assert.deepEqual(faults(undefined, { requirements }), ['requirements[0].measure', 'requirements[1].measure']);
});

test('a plan keeps its line when it is given in the other way', () => {
  const slanted = { frame: 'LIMB', entry_m: { x: 0.01, y: 0, z: 0.002 }, direction: { x: 0, y: 3, z: -4 } };
  const by_point = planGivenBy(slanted, 'target_m');
  assert.deepEqual(by_point, {
    frame: 'LIMB',
    entry_m: slanted.entry_m,
    target_m: { x: 0.01, y: 0.018, z: -0.022 },
  });
  const back = planGivenBy(by_point, 'direction');
  assert.deepEqual(back.direction, { x: 0, y: 0.6, z: -0.8 });
  assert.equal(back.target_m, undefined);
  assert.deepEqual(planGivenBy(slanted, 'direction'), slanted);
  // a direction is a ratio of its numbers, at any size
  const tiny = { ...slanted, direction: { x: 0, y: 3e-9, z: -4e-9 } };
  assert.deepEqual(planGivenBy(tiny, 'target_m').target_m, { x: 0.01, y: 0.018, z: -0.022 });
  // no line yet: straight down
  const none = planGivenBy({ ...slanted, direction: { x: 0, y: 0, z: 0 } }, 'target_m');
  assert.deepEqual(none.target_m, { x: 0.01, y: 0, z: -0.028 });
});

test('of a plan that is given in both ways the chosen one stays', () => {
  const both = {
    frame: 'LIMB',
    entry_m: { x: 0.01, y: 0, z: 0 },
    direction: { x: 0, y: 0, z: -2 },
    target_m: { x: 0, y: 0, z: -0.03 },
  };
  const faults = (plan) => courseFaults({ ...course, exercises: [{ ...course.exercises[0], plan }] });
  assert.equal(faults(both).length, 1);
  for (const by of ['direction', 'target_m']) {
    const one = planGivenBy(both, by);
    assert.deepEqual(one, { frame: 'LIMB', entry_m: both.entry_m, [by]: both[by] });
    assert.deepEqual(faults(one), []);
  }
});

test('an exercise has its number once', () => {
  assert.deepEqual(
    [numbered(1, 'Knee'), numbered(0, '1 Straight'), numbered(4, '5. Small')],
    ['2. Knee', '1 Straight', '5. Small'],
  );
});

test('an exercise that goes is required by no one any more; a new one has an id of its own', () => {
  assert.deepEqual(withoutExercise(course.exercises, 0), [{ id: 'b', name: 'B', profile_id: 'p' }]);
  assert.equal(freshId([{ id: 'exercise-3' }, { id: 'x' }]), 'exercise-4');
});

test('the next due date of a course is the earliest among what is not passed', () => {
  const asked = [{ measure: 'target_reached', min: 1 }];
  const exercises = ['a', 'b', 'c', 'd'].map((id) => ({ id, requirements: id === 'd' ? [] : asked }));
  const cell = (exercise_id, due_unix_ms, more) => ({ exercise_id, due_unix_ms, attempts: 1, ...more });
  const cells = [
    cell('a', 100, { passed: true }),
    cell('b', 300, { passed: false }),
    cell('c', 200, { attempts: 0 }),
    cell('d', 50, {}),
  ];
  assert.equal(nextDue(exercises, cells), 200, 'a is passed, d asks nothing and was tried');
  assert.equal(nextDue(exercises, [cells[0], cells[1]]), 300);
  assert.equal(nextDue(exercises, [cells[0], cells[3]]), undefined);
  assert.equal(nextDue(exercises, [cell('b', null, { passed: false }), cell('c', 0, {})]), undefined, 'never due');
  assert.equal(nextDue(exercises, []), undefined);
  // a date that is over and not passed stays the next one
  assert.equal(nextDue(exercises, [cell('b', 7, { passed: false }), cells[2]]), 7);
  assert.equal(nextDue(exercises, [cell('d', 9, { attempts: 0 }), cells[2]]), 9, 'd was not tried');
  assert.ok(!isDone({ time_limit_s: 60 }, { attempts: 2 }), 'a time limit is a requirement');
  assert.ok(!isDone({}, { attempts: 2, passed: false }), 'the server knows of a requirement');
  const held = { requirements: [{}] },
    from = { results_from_unix_ms: 5 };
  assert.deepEqual(
    [0, 1].map((attempts) => isDone(held, { attempts, ...from })),
    [false, true],
    'an exam that was taken',
  );
});

const momentsOf = (columns, profile, placement) =>
  Object.fromEntries(contactsOf(columns, profile, placement).map((c) => [c.measure, c.moments_s]));

test('contacts with bone are those of the measure', () => {
  const boneContacts = (...given) => momentsOf(...given).bone_contacts;
  const profile = {
    layers: [{ tissue: 'SKIN' }, { tissue: 'BONE' }],
    hazards: [
      { kind: 'BONE', a_m: v(0, 0, -0.02), b_m: v(0.01, 0, -0.02), radius_m: 0.002 },
      { kind: 'NERVE', center_m: v(0, 0, -0.005), radius_m: 0.004 },
    ],
  };
  const at = (t, layer, z, x = 0) => ({ t, layer, z, x });
  const columnsOf = (moments) => ({
    t_s: moments.map((m) => m.t),
    layer: moments.map((m) => m.layer),
    px_m: moments.map((m) => m.x),
    py_m: moments.map(() => 0),
    pz_m: moments.map((m) => m.z),
  });
  const gesture = [
    at(0, -1, 0.01),
    at(1, 0, -0.005), // in a nerve
    at(2, 1, -0.03), // the layer of bone
    at(2.1, 0, -0.005), // tremor: out of it for 0.1 s
    at(2.2, 1, -0.03),
    at(3, 0, -0.005),
    at(3.2, 0, -0.019, 0.008), // the hazard of bone, 0.2 s later
    at(4, -1, 0.01),
    at(5, -1, -0.02), // outside, at any place
  ];
  assert.deepEqual(boneContacts(columnsOf(gesture), profile), [2, 3.2]);
  // the same gesture at a limb that lies 10 cm aside
  const aside = gesture.map((m) => ({ ...m, x: m.x + 0.1 }));
  assert.deepEqual(boneContacts(columnsOf(aside), profile, [0.1, 0, 0, 0, 0, 0, 1]), [2, 3.2]);
  assert.deepEqual(boneContacts(columnsOf(gesture), null), []);
  assert.deepEqual(boneContacts({}, profile), []);
});

test('contacts of the hub with the skin are those of the measure', () => {
  const columns = { t_s: [0, 1, 1.1, 1.2, 2, 2.2, 3], insertion_m: [0, 0.0601, 0.06, 0.0601, 0.05, 0.07, null] };
  const hubContacts = (profile) => momentsOf(columns, profile).hub_contacts;
  assert.deepEqual(
    hubContacts({ needle: { length_m: 0.06 } }),
    [1, 2.2],
    'tremor for 0.1 s is one, 0.2 s away another',
  );
  assert.deepEqual(hubContacts({ needle: { length_m: 0.09 } }), [], 'never in to its hub');
  assert.deepEqual(hubContacts({}), []);
  assert.deepEqual(hubContacts(null), []);
});

test('a hazard is touched by the tip or by the shaft in tissue', () => {
  const hazards = [
    { kind: 'NERVE', center_m: v(0, 0, -0.01), radius_m: 0.001 },
    { kind: 'BONE', center_m: v(0, 0, -0.02), radius_m: 0.001 },
    { kind: 'VESSEL', a_m: v(0.01, -0.01, -0.005), b_m: v(0.01, 0.01, -0.005), radius_m: 0.002 },
  ];
  const touched = (x, z, layer = 0) =>
    momentsOf(
      {
        t_s: [0],
        layer: [layer],
        px_m: [x],
        py_m: [0],
        pz_m: [z],
        qx: [1],
        qy: [0],
        qz: [0],
        qw: [0],
        insertion_m: [-z],
      },
      { hazards, layers: [{ tissue: 'SKIN' }] },
    ).hazards_touched.length === 1;
  assert.ok(!touched(0, -0.0089) && touched(0, -0.0091), 'the tip at its upper edge');
  assert.ok(touched(0, -0.03), 'the shaft, when the tip is far below');
  assert.ok(!touched(0.0121, -0.03) && touched(0.0119, -0.03), 'the shaft beside a vessel across it');
  assert.ok(!touched(0.005, -0.02), 'between them; bone is told apart');
  assert.ok(!touched(0, -0.0091, -1), 'outside');
});

test('the number of contacts with bone is that of the score, not that of the points', () => {
  // 5 s at 1 kHz; bone for 0.5 s from 1 s on, and for 3 ms from 3.001 s on
  const profile = { layers: [{ tissue: 'SKIN' }, { tissue: 'BONE' }] };
  const ticks = Array.from({ length: 5000 }, (_, i) => i);
  const inBone = (i) => (i >= 1000 && i < 1500) || (i >= 3001 && i < 3004);
  const columns = (kept) => ({ t_s: kept.map((i) => i / 1000), layer: kept.map((i) => (inBone(i) ? 1 : 0)) });
  const [all] = contactsOf(columns(ticks), profile),
    [few] = contactsOf(columns(ticks.filter((i) => i % 10 === 0)), profile);
  assert.deepEqual(all.moments_s, [1, 3.001]);
  assert.deepEqual(few.moments_s, [1]);
  const none = { ...all, moments_s: [] };
  const scored = (value) => [
    { measure: 'peak_force_n', value: 7 },
    { measure: 'bone_contacts', value },
  ];
  // their number stands in the score: here only what the plot cannot show
  assert.equal(contactWords(scored(2), few), 'bone contact (1 more too short for the plot):');
  assert.equal(contactWords(scored(2), all), 'bone contact:');
  assert.equal(contactWords(scored(1), none), 'bone contact, too short for the plot');
  // the way back between two points is not seen: two moments of one contact
  assert.equal(contactWords(scored(1), all), 'bone contact:');
  for (const unscored of [undefined, [], scored(null)]) assert.equal(contactWords(unscored, few), 'bone contact:');
  assert.equal(contactWords(scored(0), none), null);
  assert.equal(contactWords(undefined, none), null);
  const hub = contactsOf({ t_s: [1], insertion_m: [0.07] }, { needle: { length_m: 0.06 } })[1];
  assert.equal(
    contactWords([{ measure: 'hub_contacts', value: 2 }], hub),
    'hub on the skin (1 more too short for the plot):',
  );
});

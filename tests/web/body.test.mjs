// A patient that is a body: in the editor, and as a cut from the server's runs.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import {
  areasOf,
  besideCut,
  entryIn,
  hazardAs,
  hazardForm,
  inSection,
  markOf,
  regionWords,
  structuresOf,
  targetAs,
} from '../../client/web/app/lib/body.js';
import { withValue } from '../../client/web/app/lib/paths.js';
import { momentWords, wayInSection } from '../../client/web/app/lib/recording.js';
import { kProfileShape, shownOf } from '../../client/web/app/lib/shape.js';
import { followLayerNames } from '../../client/web/app/lib/tissue.js';
import { HazardFields, TargetFields } from '../../client/web/app/profile/anatomy.js';
import { Structures } from '../../client/web/app/profile/structures.js';
import { Tip } from '../../client/web/app/session/replay.js';
import { BodyDrawing } from '../../client/web/app/ui/body_view.js';
import { CheckField, formOf, NumberField, SelectField, TextField } from '../../client/web/app/ui/fields.js';
import { Legend } from '../../client/web/app/ui/section.js';
import { elementsOf, textOf } from './support/page_text.mjs';
import { kVolumes, lumbar } from './support/volumes.mjs';

const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-12, `${a} is not ${b}`);

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
const kBody = {
  volume: {
    structures: [
      { id: 'skin', layer: { tissue: 'SKIN' } },
      { id: 'nerve', layer: { tissue: 'OTHER', name: 'ulnar nerve' } },
      { id: 'ulna', layer: { tissue: 'BONE' } },
    ],
  },
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
  // across × upward = x points to the viewer
  const { u, w, v } = inSection(kSection, { x: 0.105, y: 0.202, z: 0.301 });
  near(u, 0.002);
  near(w, 0.002);
  near(v, -0.005);
});

test('the place of insertion is the skin in the middle of the cut', () => {
  // column 2: outside in the top row, B below
  assert.deepEqual(entryIn(kSection), { u: 0.002, w: 0.001 });
  assert.equal(entryIn({ ...kSection, runs: [0, 4, 0, 4, 0, 4] }), undefined);
});

test('the form shows a body whole, and an edit keeps all else', () => {
  for (const profile of kVolumes) {
    assert.deepEqual(shownOf(profile, kProfileShape), { shown: profile, faults: [] });
    let saved = profile;
    const change = (next) => (saved = followLayerNames(saved, next(saved)));
    formOf({ doc: profile, shape: kProfileShape, change, problems: [] }).set('hazards[0].name')('another name');
    assert.deepEqual(saved, withValue(profile, 'hazards[0].name', 'another name'));
    assert.equal(JSON.stringify(withValue(saved, 'hazards[0].name', profile.hazards[0].name)), JSON.stringify(profile));
  }
});

/** The fields of a part of the form by their labels, and the document after the use of one. */
function fieldsOf(Part, props, doc) {
  const used = { doc };
  const change = (next) => (used.doc = next(used.doc));
  const f = formOf({ doc, shape: kProfileShape, change, problems: [] });
  const fields = elementsOf(Part({ f, i: 0, ...props(doc) }), [SelectField, TextField, NumberField, CheckField]);
  used.fields = Object.fromEntries(fields.filter((n) => n.props?.label).map((n) => [n.props.label, n.props]));
  return used;
}
const targetOf = (doc) => fieldsOf(TargetFields, (d) => ({ target: d.targets[0] }), doc);
const hazardOf = (doc) => fieldsOf(HazardFields, (d) => ({ hazard: d.hazards[0] }), doc);

test('a target that is a structure can be another structure, or a ball', () => {
  const { center_m, name } = lumbar.targets[0];
  const { fields } = targetOf(lumbar);
  assert.equal(fields.Structure.value, 'epidural');
  assert.deepEqual(fields.Structure.options.slice(1), structuresOf(lumbar));
  assert.deepEqual(fields.Structure.options[8], ['epidural', 'epidural space']);
  for (const absent of ['Radius', 'Moves with the top of', 'skin', 'Centre x'])
    assert.equal(fields[absent], undefined, absent);
  assert.equal(fields['Point to aim at z'].value, center_m.z);

  const other = targetOf(lumbar);
  other.fields.Structure.onValue('csf');
  assert.deepEqual(other.doc, withValue(lumbar, 'targets[0].structure', 'csf'));
  const ball = targetOf(lumbar);
  ball.fields.Structure.onValue('');
  assert.deepEqual(ball.doc.targets, [{ name, center_m, radius_m: 0.003 }]);
  const again = targetOf(ball.doc);
  assert.equal(again.fields.Radius.value, 0.003);
  again.fields.Structure.onValue('epidural');
  assert.deepEqual(again.doc, lumbar);
  const shells = targetOf({ layers: [{ tissue: 'SKIN' }], targets: [{ name: 't', center_m, radius_m: 0.003 }] });
  assert.equal(shells.fields.Structure, undefined, 'not for shells');
});

test('a hazard is a ball, a line, or in a body a structure', () => {
  const { fields } = hazardOf(lumbar);
  assert.deepEqual([fields.Form.value, fields.Structure.value], ['structure', 'dura']);
  for (const absent of ['Radius', 'Moves with the top of', 'Centre x', 'From x'])
    assert.equal(fields[absent], undefined, absent);
  const nerve = hazardOf(lumbar);
  nerve.fields.Structure.onValue('roots');
  assert.deepEqual(nerve.doc, withValue(lumbar, 'hazards[0].structure', 'roots'));

  const at = { x: 0.01, y: 0, z: -0.02 },
    ball = { name: 'n', kind: 'NERVE', radius_m: 0.004, anchor: { layer: 'skin', offset_m: 0 }, center_m: at };
  const line = hazardAs('line', ball);
  assert.deepEqual(line, {
    name: 'n',
    kind: 'NERVE',
    radius_m: 0.004,
    anchor: ball.anchor,
    a_m: at,
    b_m: { ...at, x: 0.03 },
  });
  assert.deepEqual(hazardAs('ball', line), ball);
  assert.deepEqual(hazardAs('structure', line, 'dura'), { name: 'n', kind: 'NERVE', structure: 'dura' });
  assert.deepEqual([ball, line, { structure: '' }].map(hazardForm), ['ball', 'line', 'structure']);
  assert.deepEqual(targetAs('dura', { name: 't', center_m: at, radius_m: 1, tissues: ['fat'], anchor: ball.anchor }), {
    name: 't',
    center_m: at,
    structure: 'dura',
  });
  const shells = hazardOf({ layers: [{ tissue: 'SKIN' }], hazards: [ball] });
  assert.deepEqual(
    shells.fields.Form.options.map(([form]) => form),
    ['ball', 'line'],
  );
});

test('the editor lists the structures with their kinds, and what is aimed at or spared', () => {
  const f = formOf({ doc: lumbar, shape: kProfileShape, change: () => {}, problems: [] });
  const kept = [SelectField, TextField, NumberField, CheckField];
  const drawn = elementsOf(Structures({ f, chosen: 7, choose: () => {} }), kept),
    select = drawn.find(({ type }) => type === SelectField);
  const words = select.props.options.map(([, text]) => text);
  assert.equal(words.length, lumbar.volume.structures.length);
  assert.equal(words[7], 'Epidural space (Fat; target: epidural space)');
  assert.equal(words[8], 'Dura and arachnoid (Dura; hazard: dural sac)');
  assert.equal(words[0], 'Skin');
  assert.equal(select.props.value, '7');
  assert.match(select.props.help, /db\/samples\/volumes/);
  // its few fields are of the chosen one
  const cutting = drawn.find(({ props }) => props?.label === 'Cutting force').props;
  assert.deepEqual(
    [cutting.path, cutting.value],
    ['volume.structures[7].layer.cutting_force_n', lumbar.volume.structures[7].layer.cutting_force_n],
  );
  // while its JSON is being typed
  for (const volume of [{}, null, 5, { structures: 5 }, { structures: [null, 5, { id: 5, layer: 'fat' }] }]) {
    const odd = formOf({ doc: { volume, targets: [{}] }, shape: kProfileShape, change: () => {}, problems: [] });
    assert.doesNotThrow(
      () => elementsOf(Structures({ f: odd, chosen: 1, choose: () => {} }), kept),
      JSON.stringify(volume),
    );
  }
});

test('a target or hazard that is a structure is called by both names', () => {
  const [target] = lumbar.targets,
    [dura, csf] = lumbar.hazards;
  assert.equal(regionWords(lumbar, target), 'epidural space');
  assert.equal(regionWords(lumbar, dura), 'dural sac (Nerve; dura and arachnoid)');
  assert.equal(regionWords(lumbar, csf), 'cerebrospinal fluid (Nerve)');
  assert.equal(regionWords(lumbar, { name: 'x', structure: 'gone' }), 'x (gone)');
  assert.equal(regionWords({ layers: [] }, { name: 'artery', kind: 'VESSEL' }), 'artery (Vessel)');
  assert.match(textOf(Legend({ profile: lumbar })), /◎ target: epidural space.*⚠ hazard: dural sac \(Nerve; dura/s);
  assert.doesNotMatch(textOf(Legend({ profile: lumbar, path: true })), /capped/);
  assert.match(textOf(Legend({ profile: lumbar, path: true, cap: true })), /tip, capped/);
  const both = { ...kBody, targets: [{ name: 'a', structure: 'nerve' }], hazards: [{ name: 'b', structure: 'nerve' }] };
  assert.deepEqual(
    [0, 1].map((i) => markOf(both, i)),
    [undefined, { kind: 'hazard', name: 'b' }],
  );
});

test('the cut of a body marks structures, shapes beside it, and the place of insertion', () => {
  const p = (off_m) => ({ x: 0.1 + off_m, y: 0.201, z: 0.301 });
  const profile = {
    ...kBody,
    targets: [
      { name: 'skin', structure: 'skin', center_m: p(0) },
      { name: 'pad', center_m: p(0), radius_m: 0.0005, tissues: ['ulnar nerve'] },
    ],
    hazards: [
      { name: 'ulnar nerve', kind: 'NERVE', structure: 'nerve' },
      { name: 'artery', kind: 'VESSEL', center_m: p(-0.01), radius_m: 0.001 },
      { name: 'moved', kind: 'OTHER', center_m: p(0), radius_m: 0.001, anchor: { layer: 'skin', offset_m: 0 } },
    ],
  };
  const props = { section: kSection, profile, label: 'a cut', room: 400, place: null };
  const drawing = BodyDrawing({ ...props, areas: areasOf(kSection), entry: entryIn(kSection) });
  const all = elementsOf(drawing),
    of = (name) => all.filter((node) => node.props?.class === name);
  const [nerve, skin] = areasOf(kSection);
  assert.deepEqual(
    of('shape-hazard-area').map((n) => n.props.d),
    [nerve.path],
  );
  assert.deepEqual(
    of('shape-target-area').map((n) => n.props.d),
    [skin.path],
  );
  assert.deepEqual(
    all.filter((n) => n.type === 'text' && n.props.class === undefined).map((n) => textOf(n).replaceAll('\u00a0', ' ')),
    ['10 mm', '◎ Skin', '⚠ Ulnar nerve'],
  );
  // the names take 26 + 6.6 (11 + 2) px; four points have the rest
  const scale = (400 - 26 - 6.6 * 13) / 4 / 0.001;
  const [artery] = of('shape-hazard');
  near(artery.props.cx, 0.001 * scale);
  near(artery.props.cy, 0.002 * scale);
  near(artery.props.r, 0.001 * scale);
  near(artery.props.opacity, 0.5); // its edge is 9 mm behind the cut
  assert.equal(textOf(of('shape-label')), 'artery, 9 mm behind');
  assert.deepEqual(
    of('shape-target').map((n) => [textOf(n), n.props.r]),
    [
      ['target: skin', 2],
      ['target: pad', 0.0005 * scale],
    ],
  );
  const clip = (i) => elementsOf(all.find((n) => n.props?.id === `target-clip-${i}`)).map((n) => n.props.d);
  assert.deepEqual(clip(2).filter(Boolean), [nerve.path], 'a target only in the tissues that count');
  assert.match(of('entry')[0].props.d, new RegExp(`^M${0.002 * scale} ${0.001 * scale}l`));
  assert.match(textOf(drawing), /Not drawn, because a structure moves it: moved\./);
});

test('names that would be cut off beside a narrow drawing stand below it', () => {
  const areas = areasOf(kSection).map((area) => ({ ...area, name: 'axillary and circumflex arteries' }));
  const props = { section: kSection, profile: kBody, label: 'a cut', place: null, areas };
  // 26 + 6.6 (32 + 2) px are more than half of 500
  for (const [room, below] of [
    [510, 0],
    [500, areas.length],
  ]) {
    const items = elementsOf(BodyDrawing({ ...props, room })).filter((node) => node.type === 'li');
    assert.equal(items.length, below, String(room));
    for (const item of items) assert.match(textOf(item), /Axillary and circumflex arteries/);
  }
});

const close = (a, b) => assert.ok(Math.abs(a - b) < 1e-6, `${a} is not ${b}`);
// X_WL turns x to y, and y to −x, then moves by (1, 2, 3): W has (1 − y, 2 + x, 3 + z)
const h = Math.SQRT1_2,
  kPlacement = [1, 2, 3, 0, 0, h, h];
const kColumns = {
  t_s: [0, 1, 2],
  px_m: [0.798, 0.798, 0.798],
  py_m: [2.1, 2.097, 2.105],
  pz_m: [3.302, 3.301, 3.301],
  // hub to tip along −z, and along y of W: x of L
  qx: [1, 1, -h],
  qy: [0, 0, 0],
  qz: [0, 0, 0],
  qw: [0, 0, h],
  layer: [-1, 1, 1],
  insertion_m: [0, 0.001, 0.001],
  capped: [1, 0, 0],
};

test('a recording in W lies in the cut of a placed body', () => {
  const way = wayInSection(kColumns, kSection, kPlacement);
  const round = ({ u, w, v }) => [u, w, v].map((x) => Math.round(x * 1e9) / 1e9 + 0);
  assert.deepEqual(way.points.map(round), [
    [0.002, 0.001, 0],
    [0.002, 0.002, 0.003],
    [0.002, 0.002, -0.005],
  ]);
  // x of L points to the viewer
  assert.deepEqual(way.axes.map(round), [
    [0, 1, 0],
    [0, 1, 0],
    [0, 0, -1],
  ]);
  assert.equal(wayInSection({}, kSection, []).points.length, 0);
});

test('the tip over a cut: needle, path so far, the cap as a ball to scale, and how far it is beside the cut', () => {
  const way = wayInSection(kColumns, kSection, kPlacement);
  const props = { section: kSection, profile: kBody, label: 'a cut', room: 400, place: null, areas: areasOf(kSection) };
  const drawn = (at_s, cap_m) => {
    const over = ({ x, y, scale }) => Tip({ way, at_s, x, y, second: 'w', length_m: 0.0005, cap_px: cap_m * scale });
    const all = elementsOf(BodyDrawing({ ...props, entry: undefined, over }));
    return (name) => all.find((node) => node.props?.class === name)?.props;
  };
  const scale = (400 - 26 - 6.6 * 13) / 4 / 0.001;
  const bare = drawn(1, 0);
  assert.equal(bare('tip-cap'), undefined);
  close(bare('tip-now').cx, 0.002 * scale);
  close(bare('tip-now').cy, 0.002 * scale);
  close(bare('tip-needle').x1, 0.002 * scale);
  close(bare('tip-needle').y1, 0.0015 * scale);
  const at = (mm) => (mm * 0.001 * scale).toFixed(1);
  assert.equal(bare('tip-path').points.trim(), `${at(2)},${at(1)} ${at(2)},${at(2)}`);
  const capped = drawn(0, 0.0003);
  assert.equal(capped('tip-now'), undefined);
  close(capped('tip-cap').r, 0.0003 * scale);

  const plain = (text) => text.replaceAll('\u00a0', ' ');
  assert.deepEqual(
    way.points.map(({ v }) => plain(besideCut(v))),
    ['Tip in the cut, or at most 2 mm beside it', 'Tip 3 mm behind the cut', 'Tip 5 mm in front of the cut'],
  );
  const words = (i) => plain(momentWords(kColumns, i, kColumns.t_s[i], ['skin', 'ulnar nerve'], 1.5));
  assert.equal(words(0), '0:00.0: outside, capped, 1.5 N');
  assert.equal(words(1), '0:01.0: in ulnar nerve, 1 mm deep, 1.5 N');
});

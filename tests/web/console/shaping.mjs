// The author of a fourth build of the knee: sliders, the section, a trial, a new profile, its exercise. And what the
// engine finds in reshaped bodies.
import assert from 'node:assert/strict';
import { mirrored, mirrorAxis, reshaped, scaled } from '../../../client/web/app/lib/reshape.js';
import { kVolumes } from '../support/volumes.mjs';
import { accessible, done, fitsWidth, open, single, unfold } from './browser.mjs';
import { until } from './lab.mjs';
import { api } from './week.mjs';

const kSamples = kVolumes.filter(({ id }) => /-median$/.test(id));

const send = (page, method, path, body, revision) =>
  page.evaluate(
    async ([method, path, body, revision]) => {
      const { csrf_token } = await (await fetch('/api/v1/session')).json();
      const headers = { 'Content-Type': 'application/json', 'X-CSRF-Token': csrf_token };
      if (revision !== undefined) headers['If-Match'] = `"${revision}"`;
      const reply = await fetch(`/api/v1/${path}`, { method, headers, body: JSON.stringify(body) });
      return { status: reply.status, json: await reply.json() };
    },
    [method, path, body, revision],
  );

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function shaping(t) {
  const it = single(t);

  it('the engine meets a reshaped body where it must', async () => {
    const page = await t.browser.as('mara');
    const metIn = async (body) => {
      const { status, json } = await send(page, 'POST', 'profiles/preview', body);
      assert.equal(status, 200, JSON.stringify(json));
      return json;
    };
    for (const body of kSamples) {
      const before = await metIn(body);
      assert.ok(before.layers.length >= 4, body.id);
      // each thickness is scaled, and a mirrored body is met in the same depths
      for (const [changed, share] of [
        [scaled(body, 1.15), 1.15],
        [scaled(body, 0.85), 0.85],
        [mirrored(body), 1],
      ]) {
        const { layers } = await metIn({ ...changed, needle: { ...body.needle, length_m: 2 * body.needle.length_m } });
        before.layers.slice(0, 6).forEach(({ name, from_m }, i) => {
          assert.equal(layers[i].name, name, body.id);
          assert.ok(Math.abs(layers[i].from_m - share * from_m) < 2e-5, `${body.id} ${name}: ${layers[i].from_m}`);
        });
      }
      // 4 mm more fat along the skin's normal: longer along the line, whose angle follows the deeper target
      const [x, y, z] = before.section.upward;
      const slopeTo = ({ x: a, y: b, z: c }) => -(x * a + y * b + z * c) / Math.hypot(a, b, c);
      const mark = { doc: body, at: { build: 0, size: 1, mirrored: '' }, up: { x, y, z } };
      const fat = reshaped(mark, { ...mark.at, fat_m: 0.004 }, null),
        more = await metIn(fat);
      const fatIn = ({ layers }) => {
        const { from_m, to_m } = layers.find(({ name }) => name === before.layers[1].name);
        return to_m - from_m;
      };
      const expected = (fatIn(before) * slopeTo(body.targets[0].center_m) + 0.004) / slopeTo(fat.targets[0].center_m);
      assert.ok(Math.abs(fatIn(more) - expected) < 0.0006, `${body.id}: ${fatIn(more)} m, not ${expected} m`);
      const skin_m = ({ layers }, { targets }) => layers[0].to_m * slopeTo(targets[0].center_m);
      assert.equal(more.layers[0].name, before.layers[0].name);
      assert.ok(Math.abs(skin_m(more, fat) - skin_m(before, body)) < 0.0003, `${body.id}: the skin stays as thick`);
    }
    await done(page);
  });

  it('a fourth build of the knee: shaped, aimed, tried, saved as another, and practised', async () => {
    const page = await t.browser.as('mara', { viewport: { width: 1440, height: 900 } });
    await open(page, t.lab, '#/profiles/knee-median', /^Knee, median/);
    const before = await api(page, 'profiles/knee-median');
    const cut = page.getByRole('img', { name: /^Cut through Knee, median/ }),
      slider = (name) => page.getByRole('slider', { name });
    await cut.getByText('Subcutaneous fat', { exact: true }).waitFor();
    await page.waitForFunction(() => !document.querySelector('.sliders [disabled]'));
    assert.equal(await slider('Build').getAttribute('aria-valuetext'), 'median');
    assert.equal(await slider('Fat').getAttribute('aria-valuetext'), '7\u00a0mm');
    assert.ok(
      await page.evaluate(() => document.documentElement.scrollHeight <= innerHeight),
      'the editor is one screen',
    );
    // the section is drawn again for each step of a slider
    const times_ms = [];
    for (const build of ['-0.2', '-0.4', '-0.6', '-0.8', '-0.9', '-0.96', '-1'])
      times_ms.push(
        await page.evaluate(async (value) => {
          const drawn = () => document.querySelector('.section [shape-rendering]').innerHTML;
          const input = document.querySelector('.slider input'),
            was = drawn(),
            begin = performance.now();
          input.value = value;
          input.dispatchEvent(new Event('input', { bubbles: true }));
          while (drawn() === was) await new Promise(requestAnimationFrame);
          return performance.now() - begin;
        }, build),
      );
    const median_ms = times_ms.sort((a, b) => a - b)[3];
    console.log(
      `# redraw of the section: ${median_ms.toFixed(0)} ms (${times_ms.map((ms) => ms.toFixed(0)).join(', ')})`,
    );
    assert.equal(await slider('Build').getAttribute('aria-valuetext'), '100 % to slender');
    assert.equal(await slider('Fat').getAttribute('aria-valuetext'), '4\u00a0mm');
    await slider('Fat').fill('14');
    await page.getByLabel('Side', { exact: true }).selectOption('left');

    // the target goes where it is dragged: by the section's own scale
    await page.waitForLoadState('networkidle');
    const json = page.getByLabel('JSON', { exact: true });
    await unfold(page);
    const document_ = async () => JSON.parse(await json.inputValue());
    const shaped = await document_();
    assert.match(shaped.description, /^Left knee/);
    assert.match(shaped.sources, /Changed in the editor: build 100 % to slender, subcutaneous fat 14\smm, mirrored\.$/);
    const grip = async (what) => {
      const box = await page.locator(`[data-grip=${what}]`).boundingBox();
      return { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    };
    const drag = async (what, dx, dy) => {
      const from = await grip(what);
      await page.mouse.move(from.x, from.y);
      await page.mouse.down();
      await page.mouse.move(from.x + dx, from.y + dy, { steps: 4 });
      await page.mouse.up();
    };
    const ruler = cut.locator('.ruler line');
    const pixels = Number(await ruler.getAttribute('x2')) - Number(await ruler.getAttribute('x1')); // of 10 mm
    await drag('target', 0, 0.2 * pixels);
    const aimed = await document_(),
      moved_m = Math.hypot(
        ...['x', 'y', 'z'].map((axis) => aimed.targets[0].center_m[axis] - shaped.targets[0].center_m[axis]),
      );
    assert.ok(Math.abs(moved_m - 0.002) < 1e-4, `${moved_m} m instead of 2 mm`);
    assert.deepEqual(aimed.volume, shaped.volume);
    await drag('target', 0, -0.2 * pixels);
    await page.waitForLoadState('networkidle');
    // the entry goes along the skin: everything else moves against it
    await drag('entry', 0.1 * pixels, 0);
    await until(
      'the new entry',
      async () =>
        (await document_()).volume.groups[0].parts[0].capsule.a_m.y !== aimed.volume.groups[0].parts[0].capsule.a_m.y,
    );
    const entered = await document_(),
      way_m = ['x', 'y', 'z'].map((axis) => entered.targets[0].center_m[axis] - shaped.targets[0].center_m[axis]);
    assert.ok(Math.abs(Math.hypot(...way_m) - 0.001) < 6e-4, `moved by ${way_m}`);

    // the hand on the planned line
    await page.getByRole('button', { name: 'Try it' }).click();
    const look = page.getByRole('complementary', { name: 'What it looks and feels like' });
    await look.getByText(/^\s*Met: skin at 0\smm, subcutaneous fat at .*The target is reached\./).waitFor();
    await look.getByText('✓', { exact: false }).first().waitFor();
    await look.getByRole('heading', { name: 'Knee: suprapatellar recess', exact: true }).waitFor();
    assert.match(await look.innerText(), /Target reached: yes[\s\S]*4 requirements more/);
    // another structure of the section, and one of its fields
    await page.getByLabel('Chosen structure').selectOption({ label: 'Joint capsule' });
    assert.equal(
      await page.getByLabel(/^Gives way at/).inputValue(),
      String(entered.volume.structures.find(({ id }) => id === 'capsule').layer.puncture.force_n),
    );
    await accessible(page, "a body's editor");

    await page.getByRole('button', { name: 'Save as another …' }).click();
    await page.getByRole('heading', { level: 1, name: 'New profile' }).waitFor();
    await page.getByLabel('Id', { exact: true }).fill('knee-fourth');
    await page
      .getByRole('form', { name: 'Profile' })
      .getByLabel('Name', { exact: true })
      .first()
      .fill('Knee, slender with much fat');
    await page.getByText('✓ No problems found').waitFor();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.waitForURL(/#\/profiles\/knee-fourth$/);
    await page
      .getByRole('img', { name: /^Cut through Knee, slender with much fat/ })
      .getByText('Subcutaneous fat', { exact: true })
      .waitFor();
    await page.waitForFunction(() => !document.querySelector('.sliders [disabled]'));
    assert.equal(await slider('Fat').getAttribute('aria-valuetext'), '14\u00a0mm');
    assert.match(await slider('Build').getAttribute('aria-valuetext'), /^(9\d|100) % to slender$/);
    assert.equal((await api(page, 'profiles/knee-median')).revision, before.revision, 'the median knee stayed');

    // its exercise can be begun
    const { json: stored } = await api(page, 'profiles/knee-fourth');
    const { x, y, z } = stored.targets[0].center_m;
    const course = {
      id: 'fourth',
      name: 'The fourth knee',
      exercises: [
        {
          id: 'fourth-knee',
          name: 'Fourth knee',
          profile_id: 'knee-fourth',
          requirements: [{ measure: 'target_reached', min: 1 }],
          plan: { frame: 'LIMB', entry_m: { x: 0, y: 0, z: 0 }, target_m: { x, y, z } },
        },
      ],
    };
    const put = await send(page, 'PUT', 'courses/fourth', course, 0);
    assert.equal(put.status, 200, JSON.stringify(put.json));
    const lesson = t.lab.practise('station-1', 'guest', 'fourth-knee', ['--hand-speed-m-s', '0.03', '--seconds', '3']);
    assert.equal(await lesson.ended, 0, lesson.said);
    await done(page);
  });

  it('a body is checked when it is saved as when it is imported', async () => {
    const page = await t.browser.as('mara');
    page.expected.add(400);
    const body = kSamples.find(({ id }) => id === 'knee-median');
    const mark = {
      doc: { ...body, id: 'knee-giant' },
      at: { build: 0, size: 1, mirrored: '' },
      up: { x: 0, y: 0, z: 1 },
    };
    // a thigh of 2.3 m: the slider does not go so far
    const giant = reshaped(mark, { ...mark.at, size: 40 }, null);
    const put = await send(page, 'PUT', 'profiles/knee-giant', giant, 0);
    assert.equal(put.status, 400);
    const file = t.lab.write('giant.json', JSON.stringify(giant));
    const message = await t.lab.admin('profile', 'import', file).then(
      () => assert.fail('it was imported'),
      (error) => String(error.message),
    );
    const said = put.json.error?.message ?? put.json.message;
    const fault = /volume\.\S+: .*out of range[^\n]*/.exec(said)?.[0];
    assert.ok(fault && message.includes(fault), `${said}\n${message}`);
    await done(page);
  });

  it('what a body cannot do is said', async () => {
    const page = await t.browser.as('mara', { viewport: { width: 390, height: 844 } });
    const body = structuredClone(kSamples.find(({ id }) => id === 'wrist-median'));
    const { volume } = body;
    volume.rules = volume.rules.filter(({ structure }) => structure !== 'fat');
    const lean = { ...body, id: 'lean-wrist', name: 'A wrist without fat', volume };
    assert.equal((await send(page, 'PUT', 'profiles/lean-wrist', lean, 0)).status, 200);
    await open(page, t.lab, '#/profiles/lean-wrist', 'A wrist without fat');
    await page.getByText('No stored slender, median and heavy body has these shapes.').waitFor();
    await page.getByText('No rule of this body puts a layer of fat under its skin.').waitFor();
    assert.ok(await page.getByRole('slider', { name: 'Build' }).isDisabled());
    assert.ok(await page.getByRole('slider', { name: 'Fat' }).isDisabled());
    assert.ok(await page.getByRole('slider', { name: 'Size' }).isEnabled());
    await fitsWidth(page, "a body's editor");
    await done(page);
  });
}

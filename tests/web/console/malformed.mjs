// Documents whose JSON has values of wrong types: the editors show what they can, name each fault, and write nothing.
import assert from 'node:assert/strict';
import { accessible, confirmed, done, open, single, unfold } from './browser.mjs';
import { api } from './week.mjs';

/** Changes of a profile, and the faults that the editor names: field, and the beginning of the message. */
const kProfiles = [
  ['layers: 5', (d) => ({ ...d, layers: 5 }), 'Layers', 'must be a list, found the number 5'],
  ['no layers', ({ layers, ...d }) => d, 'Layers', 'is missing'],
  ['a null layer', (d) => ({ ...d, layers: [d.layers[0], null] }), 'Layer 2', 'must be an object, found null'],
  ['a layer that is a text', (d) => ({ ...d, layers: ['fat'] }), 'Layer 1', 'must be an object, found the text "fat"'],
  [
    'a layer that is a list',
    (d) => ({ ...d, layers: [[], ...d.layers] }),
    'Layer 1',
    'must be an object, found a list',
  ],
  [
    'a thickness that is a text',
    (d) => ({ ...d, layers: [{ ...d.layers[0], thickness_m: 'NaN' }] }),
    'Layer 1, thickness',
    'must be a number, found the text "NaN"',
  ],
  [
    'a huge thickness',
    (d) => ({ ...d, layers: [{ ...d.layers[0], thickness_m: 1e300 }] }),
    'Layer 1, thickness',
    '1e+303 mm is out of range',
  ],
  [
    'a membrane that is a number',
    (d) => ({ ...d, layers: [{ ...d.layers[0], puncture: 7 }] }),
    'Layer 1, puncture',
    'must be an object, found the number 7',
  ],
  ['targets: {}', (d) => ({ ...d, targets: {} }), 'Targets', 'must be a list, found an object'],
  ['a null target', (d) => ({ ...d, targets: [null] }), 'Target 1', 'must be an object, found null'],
  ['hazards: null', (d) => ({ ...d, hazards: null }), 'Hazards', 'must be a list, found null'],
  [
    'a place of wrong types',
    (d) => ({ ...d, hazards: [{ name: 'n', kind: 'NERVE', center_m: { x: {}, y: null, z: 1e300 }, radius_m: 0.1 }] }),
    'Hazard 1, centre x',
    'must be a number, found an object',
  ],
  ['limb: []', (d) => ({ ...d, limb: [] }), 'Shape', 'must be an object, found a list'],
  [
    'a plane that is a text',
    (d) => ({ ...d, limb: { plane: 'flat' } }),
    'Limb plane',
    'must be an object, found the text "flat"',
  ],
  ['needle: 5', (d) => ({ ...d, needle: 5 }), 'Needle', 'must be an object, found the number 5'],
  ['directions: []', (d) => ({ ...d, directions: [] }), 'Directions', 'must be an object, found a list'],
  [
    'a direction that is a number',
    (d) => ({ ...d, directions: { plus_x: 5 } }),
    '+x',
    'must be a text, found the number 5',
  ],
  ['tracking_wall: true', (d) => ({ ...d, tracking_wall: true }), 'Tracking wall', 'must be an object, found true'],
  ['effects: {}', (d) => ({ ...d, effects: {} }), 'Effects', 'must be a list, found an object'],
  ['an effect that is null', (d) => ({ ...d, effects: [null] }), 'Effect 1', 'must be '],
  [
    'a model that is unknown',
    (d) => ({ ...d, axial_model: 'MAGIC' }),
    'Model along the needle',
    '"MAGIC" is not one of',
  ],
  ['a name that is a number', (d) => ({ ...d, name: 12 }), 'Name', 'must be a text, found the number 12'],
];

const exercise = (d, changes) => ({ ...d, exercises: [{ ...d.exercises[0], ...changes }] });
const kCourses = [
  ['exercises: 7', (d) => ({ ...d, exercises: 7 }), 'Exercises', 'must be a list, found the number 7'],
  [
    'a null exercise',
    (d) => ({ ...d, exercises: [...d.exercises, null] }),
    'Exercise 2',
    'must be an object, found null',
  ],
  ['plan: []', (d) => exercise(d, { plan: [] }), 'Exercise 1, plan', 'must be an object, found a list'],
  [
    'an entry that is a text',
    (d) => exercise(d, { plan: { frame: 'LIMB', entry_m: 'here', direction: { x: 0, y: 0, z: -1 } } }),
    'Exercise 1, entry on the skin',
    'must be an object, found the text "here"',
  ],
  ['aids: 5', (d) => exercise(d, { aids: 5 }), 'Exercise 1, aids', 'must be an object, found the number 5'],
  [
    'allowed: 5',
    (d) => exercise(d, { aids: { allowed: 5 } }),
    'Exercise 1, what the station may show',
    'must be a list, found the number 5',
  ],
  [
    'prerequisites: "x"',
    (d) => exercise(d, { prerequisites: 'x' }),
    'Exercise 1, must be passed first',
    'must be a list, found the text "x"',
  ],
  [
    'a prerequisite that is null',
    (d) => exercise(d, { prerequisites: [null] }),
    'Exercise 1, prerequisite 1',
    'must be a text, found null',
  ],
  [
    'requirements: {}',
    (d) => exercise(d, { requirements: {} }),
    'Exercise 1, requirements',
    'must be a list, found an object',
  ],
  [
    'a null requirement',
    (d) => exercise(d, { requirements: [null] }),
    'Exercise 1, requirement 1',
    'must be an object, found null',
  ],
  [
    'a due date beyond all time',
    (d) => exercise(d, { due_unix_ms: 1e300 }),
    'Exercise 1, due',
    '1e+300 is out of range',
  ],
  [
    'an id that is a number',
    (d) => exercise(d, { id: 5 }),
    'Exercise 1, exercise id',
    'must be a text, found the number 5',
  ],
  [
    'a needle that is a list',
    (d) => exercise(d, { needle: [] }),
    'Exercise 1, needle',
    'must be an object, found a list',
  ],
];
/** Texts that are not documents: said under the text, and the document stays as it is. */
const kTexts = [
  ['NaN', 'This is not JSON yet'],
  ['{"name": NaN}', 'This is not JSON yet'],
  ['null', 'A document must be an object in braces, found null'],
  ['5', 'A document must be an object in braces, found the number 5'],
  ['[]', 'A document must be an object in braces, found a list'],
  ['{"max_force_n": 1e999}', 'force: is too large for a number'],
  [`{"a": ${'['.repeat(5000)}${']'.repeat(5000)}}`, 'is nested deeper than 32'],
];

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function malformed(t) {
  const it = single(t);
  /** Types each case into the JSON of one document, then mends it there. */
  const edits = async (kind, id, form, cases) => {
    const page = await t.browser.as('mara');
    // the force cannot be rendered
    page.expected.add(400);
    await open(page, t.lab, `#/${kind}/${id}`);
    const before = await api(page, `${kind}/${id}`);
    const problems = page.getByRole('status', { name: 'Problems of this form' });
    await problems.getByText('✓ No problems found').waitFor();
    await unfold(page);
    const json = page.getByLabel('JSON', { exact: true });
    const whole = JSON.parse(await json.inputValue());
    for (const [what, change, path, words] of cases) {
      await page.evaluate((name) => (document.body.dataset.case = name), what);
      const wrong = JSON.stringify(change(whole));
      await json.fill(wrong);
      const line = problems
        .getByRole('listitem')
        .filter({ has: page.getByRole('button', { name: path, exact: true }) });
      await line.getByText(words).first().waitFor();
      assert.equal(await json.inputValue(), wrong, `${what}: what was typed is still there`);
      assert.ok(await page.getByRole('form', { name: form }).isVisible(), what);
      // to its field, or to the JSON where it has none
      await line.getByRole('button', { name: path, exact: true }).click();
      assert.ok(await page.evaluate(() => document.activeElement.hasAttribute('data-path')), `${what}: nowhere to go`);
      assert.deepEqual(page.faults, [], what);
    }
    for (const [text, words] of kTexts) {
      await json.fill(text);
      await page.getByText(words).first().waitFor();
      assert.deepEqual(page.faults, [], text.slice(0, 40));
    }
    await json.fill(JSON.stringify(whole, null, 2));
    await problems.getByText('✓ No problems found').waitFor();
    assert.ok(await page.getByRole('button', { name: 'Save', exact: true }).isDisabled(), 'nothing has changed');
    assert.equal((await api(page, `${kind}/${id}`)).revision, before.revision, 'nothing was saved');
    await done(page);
  };

  it('a profile of wrong types: each fault is named, and mended in the JSON', () =>
    edits('profiles', 'knee-adult', 'Profile', kProfiles));

  it('a course of wrong types: each fault is named, and mended in the JSON', async () => {
    const page = await t.browser.as('mara');
    const course = {
      id: 'malformed',
      name: 'Of one exercise',
      exercises: [{ id: 'malformed-1', name: 'Knee', profile_id: 'knee-adult' }],
    };
    const status = await page.evaluate(async (body) => {
      const { csrf_token } = await (await fetch('/api/v1/session')).json();
      const headers = { 'Content-Type': 'application/json', 'X-CSRF-Token': csrf_token, 'If-Match': '"0"' };
      return (await fetch(`/api/v1/courses/${body.id}`, { method: 'PUT', headers, body: JSON.stringify(body) })).status;
    }, course);
    assert.equal(status, 200);
    await done(page);
    await edits('courses', 'malformed', 'Course', kCourses);
  });

  it('whatever is wrong with a document is said in the words of the form', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/profiles/knee-adult');
    const wrong = [undefined, null, 'x', 1e300, -12345.678901234, [], {}, true];
    const found = await page.evaluate(async (values) => {
      const { placeWords, problemWords } = await import('/app/lib/plain_words.js');
      const { checkProfile, checkCourse, documents } = await import('/app/net/requests.js');
      const { withValue, writePath } = await import('/app/lib/paths.js');
      const placesOf = (value, at = []) =>
        value && typeof value === 'object'
          ? Object.keys(value).flatMap((key) => {
              const here = [...at, Array.isArray(value) ? Number(key) : key];
              return [here, ...placesOf(value[key], here)];
            })
          : [];
      const said = new Set();
      for (const [kind, id, check] of [
        ['profiles', 'knee-adult', checkProfile],
        ['courses', 'malformed', checkCourse],
      ]) {
        const { json } = await documents(kind).one(id);
        json.exercises?.forEach((e) =>
          Object.assign(e, {
            needle: { length_m: 0.06, tip: 'TUOHY' },
            requirements: [{ measure: 'peak_force_n', min: 2, max: 1 }],
            plan: { frame: 'LIMB', entry_m: { x: 0, y: 0, z: 0 }, direction: { x: 0, y: 0, z: -1 } },
          }),
        );
        for (const place of [[], ...placesOf(json)])
          for (const value of [...values, ...(place.length ? [] : [{ ...json, odd_field: 1 }])])
            for (const p of await check(place.length ? withValue(json, writePath(place), value) : (value ?? {})))
              said.add(`${placeWords(p.path)}: ${problemWords(p)}`);
      }
      return [...said];
    }, wrong);
    assert.ok(found.length > 300, `${found.length} messages`);
    // what is quoted was typed
    const raw = /[a-z]_[a-z]|\w\[\d|\b[A-Z]{3,}\b|\d+\.\d{6,}|[0-9a-f]{8}-[0-9a-f]{4}-/;
    assert.deepEqual(
      found.filter((text) => raw.test(text.replace(/"[^"]*"/g, '').replace(/\b(JSON|FEM)\b/g, ''))),
      [],
    );
    await done(page);
  });

  it('the form changes only what it was told to: what it cannot show stays', async () => {
    const page = await t.browser.as('mara');
    page.expected.add(400);
    await open(page, t.lab, '#/profiles/knee-adult');
    await unfold(page);
    const json = page.getByLabel('JSON', { exact: true });
    const whole = JSON.parse(await json.inputValue());
    const odd = {
      ...whole,
      layers: [whole.layers[0], null, 'fat'],
      effects: ['CUTTING', 'LATER'],
      needle: { length_m: 'NaN' },
      axial_model: 'MAGIC',
    };
    const drawing = page.getByRole('img', { name: /^Side view of/ });
    await drawing.getByText(/φ/).first().waitFor();
    await json.fill(JSON.stringify(odd));
    // a layer without thickness has no size, and one that cannot be rendered no fidelity
    await drawing.getByText('Layer 2 –').waitFor();
    await page.getByText('This is the last version that could be rendered.').waitFor();
    assert.equal(await drawing.getByText(/φ/).count(), 0);
    assert.equal(await page.getByLabel('Model along the needle').inputValue(), 'MAGIC');
    const now = async () => JSON.parse(await json.inputValue());
    await page.getByRole('button', { name: 'Move layer 1 down' }).click();
    assert.deepEqual(await now(), { ...odd, layers: [null, whole.layers[0], 'fat'] });
    await confirmed(page, page.getByRole('button', { name: 'Remove layer 3' }), 'Remove');
    assert.deepEqual(await now(), { ...odd, layers: [null, whole.layers[0]] });
    await page.getByLabel(/^Shaft friction$/).check();
    assert.deepEqual((await now()).effects, ['CUTTING', 'SHAFT_FRICTION', 'LATER']);
    assert.deepEqual((await now()).needle, { length_m: 'NaN' });
    assert.equal(
      await page
        .getByRole('group', { name: 'Needle' })
        .getByLabel(/^Length/)
        .inputValue(),
      '"NaN"',
    );
    assert.ok(await page.getByRole('button', { name: 'Save', exact: true }).isDisabled(), 'a field holds no number');
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await page.getByText('✓ No problems found').waitFor();
    assert.deepEqual(await now(), whole);
    await done(page);
  });

  it('what is typed into the JSON and what the form changes meanwhile stay apart until somebody chooses', async () => {
    const page = await t.browser.as('mara');
    // the force cannot be rendered
    page.expected.add(400);
    await open(page, t.lab, '#/profiles/knee-adult');
    const { revision } = await api(page, 'profiles/knee-adult');
    await unfold(page);
    const json = page.getByLabel('JSON', { exact: true }),
      name = page.getByLabel('Name', { exact: true }).first(),
      save = page.getByRole('button', { name: 'Save', exact: true });
    const reason = page.getByText('The JSON text is not in the document'),
      meanwhile = page.getByText('The form has changed meanwhile');
    const whole = JSON.parse(await json.inputValue());
    await name.fill('Knee A');
    assert.ok(await save.isEnabled());

    // a text that is not a document: nothing is saved without it, and the page says why
    await json.fill('{"name": ');
    await reason.waitFor();
    assert.ok(await save.isDisabled());
    await page.keyboard.press('Control+s');
    await name.fill('Knee B');
    await meanwhile.waitFor();
    assert.equal(await json.inputValue(), '{"name": ', 'what was typed stays');
    assert.ok(await page.getByRole('button', { name: 'Take this text' }).isDisabled());
    // a document again, but not the form's: neither replaces the other
    const typed = JSON.stringify({ ...whole, description: 'typed' });
    await json.fill(typed);
    await page.getByText('This is not JSON yet').waitFor({ state: 'detached' });
    assert.equal(await name.inputValue(), 'Knee B');
    assert.ok(await save.isDisabled());
    await accessible(page, 'a JSON beside another form');
    await page.getByRole('button', { name: 'Take this text' }).click();
    await reason.waitFor({ state: 'detached' });
    assert.equal(await name.inputValue(), whole.name);
    assert.equal(await json.inputValue(), typed);

    await json.fill(`${typed.slice(0, -1)}, "id": "knee-adult"}`);
    await page.getByText('id: is given twice').waitFor();
    await name.fill('Knee C');
    await meanwhile.waitFor();
    await page.getByRole('button', { name: "Take the form's" }).click();
    await reason.waitFor({ state: 'detached' });
    assert.deepEqual(JSON.parse(await json.inputValue()), { ...whole, description: 'typed', name: 'Knee C' });
    assert.ok(await save.isEnabled());

    await json.fill('x');
    await reason.waitFor();
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await reason.waitFor({ state: 'detached' });
    await page.getByRole('heading', { level: 1, name: whole.name }).waitFor();
    await page.getByText('not saved yet').waitFor({ state: 'detached' });
    assert.deepEqual(JSON.parse(await json.inputValue()), whole);
    assert.equal((await api(page, 'profiles/knee-adult')).revision, revision, 'nothing was saved');

    await open(page, t.lab, '#/courses/malformed');
    await name.fill('Of one');
    await unfold(page);
    await json.fill('{');
    await reason.waitFor();
    assert.ok(await save.isDisabled());
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await done(page);
  });

  it('a fidelity is that of the patient in the form: none while the engine is asked again', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/profiles/knee-adult');
    await unfold(page);
    const drawing = page.getByRole('img', { name: /^Side view of/ });
    await drawing.getByText(/φ/).first().waitFor();
    let answer;
    const asked = new Promise((resolve) => (answer = resolve));
    await page.route(/\/profiles\/preview$/, async (route) => {
      await asked;
      await route.continue();
    });
    await page
      .getByLabel(/^Thickness/)
      .first()
      .fill('3.5');
    await page.getByText('Rendering …').waitFor();
    assert.equal(await drawing.getByText(/φ/).count(), 0);
    answer();
    await drawing.getByText(/φ/).first().waitFor();
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await done(page);
  });

  it('a profile that calls itself another is not saved over that one', async () => {
    const page = await t.browser.as('mara');
    page.expected.add(400);
    await open(page, t.lab, '#/profiles/knee-adult');
    const others = await api(page, 'profiles/shoulder-adult');
    await unfold(page);
    const json = page.getByLabel('JSON', { exact: true });
    await json.fill(JSON.stringify({ ...JSON.parse(await json.inputValue()), id: 'shoulder-adult' }));
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText("id: is not 'knee-adult', as in the address").first().waitFor();
    assert.deepEqual(await api(page, 'profiles/shoulder-adult'), others);
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await done(page);
  });

  it('what the server says between press and release does not move what is pressed', async () => {
    const page = await t.browser.as('mara');
    // the force cannot be rendered
    page.expected.add(400);
    await open(page, t.lab, '#/profiles/knee-adult');
    const problems = page.getByRole('status', { name: 'Problems of this form' });
    const beside = page.getByRole('form', { name: 'Profile' });
    const scrolled = () => beside.evaluate((element) => element.scrollTop);
    const link = (path) => problems.getByRole('button', { name: path, exact: true });
    await problems.getByText('✓ No problems found').waitFor();
    await unfold(page);
    const json = page.getByLabel('JSON', { exact: true });
    const whole = JSON.parse(await json.inputValue());
    const last = `Layer ${whole.layers.length}, thickness`;
    await json.fill(JSON.stringify({ ...whole, layers: whole.layers.map((l) => ({ ...l, thickness_m: 0 })) }));
    await link(last).waitFor();
    await page.getByText('This is the last version that could be rendered.').waitFor();

    let answer;
    const pressed = new Promise((resolve) => (answer = resolve));
    await page.route(/\/profiles\/check$/, async (route) => {
      await pressed;
      await route.continue();
    });
    await json.fill(JSON.stringify({ ...whole, needle: 5 }));
    // its answer makes the list shorter, and its column cannot stay scrolled as far
    await beside.evaluate((element) => (element.scrollTop = element.scrollHeight));
    await link('Needle').hover();
    const before = await scrolled();
    await page.mouse.down();
    const answered = page.waitForEvent('requestfinished', (request) => request.url().endsWith('/profiles/check'));
    answer();
    await answered;
    // the page has it, too: it has the answer to a later question, and was drawn since
    await page.evaluate(async () => {
      await fetch('/api/v1/session');
      for (let frame = 0; frame < 2; frame++) await new Promise(requestAnimationFrame);
    });
    await page.mouse.up();
    assert.equal(await page.evaluate(() => document.activeElement.dataset.path), 'needle.length_m');
    await link(last).waitFor({ state: 'detached' });
    assert.ok((await scrolled()) < before, 'the list moved when it was released');
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await done(page);
  });
}

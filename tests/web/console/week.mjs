// A week of a course's manager in the browser, from the class list to the exported scores.
import assert from 'node:assert/strict';
import { isOfTissueNotMet, measureText } from '../../../client/web/app/lib/measures.js';
import { accessible, chooseFrom, done, downloaded, open, printedPages, settled, story, unfold } from './browser.mjs';
import { until } from './lab.mjs';

const kClass = ['anna.bauer', 'ben.osei', 'chen.li', 'dora.kovacs'];
const csvOf = (rows) => ['name,full_name,role,group', ...rows].join('\n') + '\n';
const kRows = [
  'anna.bauer,Anna Bauer,trainee,autumn',
  'ben.osei,Ben Osei,trainee,autumn',
  'chen.li,"Li, Chen",trainee,autumn',
  'dora.kovacs,Dóra Kovács,trainee,autumn',
];
const kGood = ['--hand-speed-m-s', '0.03', '--hand-hold-s', '1.5', '--hand-seed', '7'];

/** JSON of the server, fetched with the page's own cookie. */
export const api = (page, path) => page.evaluate(async (at) => (await fetch(`/api/v1/${at}`)).json(), path);

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t filled before the first test runs */
export function week(t) {
  const it = story(t);
  let page, stations, expert;

  it('imports a class: what is wrong is said before anything happens', async () => {
    page = await t.browser.as('mara');
    await open(page, t.lab, '#/people', 'People');
    await page.getByRole('link', { name: 'Import from CSV' }).click();
    await page.getByLabel('CSV file').setInputFiles({
      name: 'class.csv',
      mimeType: 'text/csv',
      buffer: Buffer.from(csvOf([...kRows, 'flo.new,Flo,wizard,autumn', 'eve,Eve,administrator,'])),
    });
    await page.getByRole('button', { name: /^Check/ }).click();
    await page.getByText('2 rows are wrong').waitFor();
    assert.equal(await page.getByRole('row', { name: /wrong/ }).count(), 2);
    assert.ok(await page.getByRole('button', { name: 'Import', exact: true }).isDisabled());
    await accessible(page, 'the import with faults');
    assert.ok(!(await api(page, 'people')).items.some((p) => p.name === 'anna.bauer'), 'a dry run changed something');

    await page.getByLabel('The list').fill(csvOf(kRows));
    await page.getByRole('button', { name: /^Check/ }).click();
    await page.getByText('4 new, 0 changed, 0 unchanged, 0 wrong').first().waitFor();
    await page.getByRole('button', { name: 'Import', exact: true }).click();
    await page.getByText('✓ Imported:').waitFor();
    await page.getByRole('link', { name: 'Show the people' }).click();
    await page.getByRole('link', { name: 'chen.li' }).waitFor();
    assert.match(await page.getByRole('row', { name: /chen\.li/ }).innerText(), /Li, Chen.*autumn/s);
    const group = await api(page, 'groups/autumn');
    assert.deepEqual(group.members, kClass);
  });

  it('takes a registrar’s list as it comes: asks once which column is the account, names what it ignores', async () => {
    await open(page, t.lab, '#/people/import', 'Import people');
    const list = (row) => `Name;Vorname;E-Mail;Studiengang\r\n${row}\r\n`;
    const check = async (row) => {
      await page.getByLabel('The list').fill(list(row));
      await page.getByRole('button', { name: /^Check/ }).click();
    };
    await check('Weiß;Gerd;gerd@uni.example;Medizin');
    const form = page.getByRole('form', { name: 'Columns of the list' });
    await form.getByLabel('Account').selectOption('E-Mail');
    await accessible(page, 'the question about columns');
    assert.ok(await page.getByRole('button', { name: 'Import', exact: true }).isDisabled());
    await form.getByRole('button', { name: 'Use these columns' }).click();
    await page.getByText('Ignored: Studiengang.').waitFor();
    await page.getByRole('row', { name: /gerd@uni\.example .*added as trainee/ }).waitFor();
    // the next list with this header is not asked about, even after the page is loaded again
    await page.reload();
    await check('Groß;Hanna;hanna@uni.example;Medizin');
    await page.getByText('“E-Mail” is the account').waitFor();
    await page.getByText('1 new, 0 changed, 0 unchanged, 0 wrong').first().waitFor();
    assert.equal(await form.count(), 0);
    await page.getByRole('button', { name: 'Import', exact: true }).click();
    await page.getByText('✓ Imported:').waitFor();
    assert.equal((await api(page, 'people/hanna%40uni.example')).full_name, 'Hanna Groß');
    await page.getByRole('button', { name: 'Choose again' }).click();
    await form.getByLabel('Full name').waitFor();
  });

  it('makes a patient from another one: drawing and force follow what is typed', async () => {
    await open(page, t.lab, '#/profiles', 'Patient profiles');
    await page.getByRole('link', { name: 'Make a copy of Knee, adult, median' }).click();
    await page.getByLabel('Id', { exact: true }).waitFor();
    await unfold(page);
    await page.getByLabel('Id', { exact: true }).fill('knee-autumn');
    await page.getByLabel('Name', { exact: true }).first().fill('Knee, autumn course');
    // the needle of 50 mm reaches so far
    await page
      .getByText(/^Force against the needle over 50\smm of depth: greatest/)
      .last()
      .waitFor();
    const drawing = page.getByRole('img', { name: /Side view of 6 layers, 52\smm deep/ });
    await drawing.getByText(/^Fat 6\smm, φ/).waitFor();
    // 8 mm of fat instead of 6: the drawing's label, and everything below it 2 mm deeper in what the engine renders
    const rendered = page.waitForResponse(
      async (r) => r.url().endsWith('/profiles/preview') && r.ok() && (await r.json()).layers?.[1].to_m > 0.0105,
    );
    await page
      .getByRole('listitem')
      .filter({ has: page.getByRole('heading', { name: /2\. Fat/ }) })
      .getByLabel(/^Thickness/)
      .fill('8');
    await page
      .getByRole('img', { name: /Side view of 6 layers, 54\smm deep/ })
      .getByText(/^Fat 8\smm, φ/)
      .waitFor();
    const preview = await (await rendered).json();
    // a layer gets its own name: in its card and in the drawing
    const bone = page.getByRole('listitem').filter({ has: page.getByRole('heading', { name: /^6\. / }) });
    await bone.getByLabel('Name', { exact: true }).fill('femur');
    await bone.getByRole('heading', { name: /^6\. Femur/ }).waitFor();
    await page
      .getByRole('img', { name: /Side view of 6 layers/ })
      .getByText(/^Femur 25\smm/)
      .waitFor();
    assert.ok(Math.abs(preview.layers[1].to_m - 0.011) < 1e-9);
    const cutting = preview.by_effect.find((e) => e.effect === 'CUTTING').force_n;
    const at = (depth_m) => preview.depth_m.findIndex((d) => d >= depth_m);
    // the middle of each layer takes its own cutting force: 0.4 N of fat, 1.6 N of muscle
    for (const [depth_m, newton] of [
      [0.007, 0.4],
      [0.015, 1.6],
    ])
      assert.ok(
        Math.abs(cutting[at(depth_m)] - newton) < 0.02,
        `${cutting[at(depth_m)]} N at ${depth_m} m, not ${newton}`,
      );
    // the bone stops the needle: 20 mm below its surface the spring is at the device's limit
    assert.ok(Math.abs(preview.total_n[at(0.049)] - preview.max_force_n) < 1e-6, `${preview.total_n[at(0.049)]} N`);
    await page
      .getByRole('status', { name: 'Problems of this form' })
      .getByText(/No problems|warning/)
      .first()
      .waitFor();
    // a way that the sample has no name for
    await page.getByRole('group', { name: 'Directions' }).getByLabel('+y', { exact: true }).fill('towards the patella');
    await accessible(page, 'the profile editor');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('was saved as revision 1').waitFor();
    await page.waitForURL(/#\/profiles\/knee-autumn$/);
    assert.ok(JSON.stringify(await api(page, 'profiles/knee-autumn')).includes('towards the patella'));
  });

  it('refuses what cannot be while it is typed, and shows where', async () => {
    await page.getByRole('heading', { level: 1, name: 'Knee, autumn course' }).waitFor();
    await unfold(page);
    const field = page.getByLabel(/^Cutting force/).nth(2);
    // an invalid profile has no force to draw
    page.expected.add(400);
    await field.fill('abc');
    await page.getByText('“abc” is not a number; write it like 3.5').waitFor();
    assert.equal(await field.getAttribute('aria-invalid'), 'true');
    await field.fill('-3');
    await page
      .locator('.field-problem, .field .error')
      .getByText(/outside|range|from 0/)
      .first()
      .waitFor();
    await page.getByRole('button', { name: 'Layer 3, cutting force' }).first().click();
    assert.ok(await field.evaluate((e) => e === document.activeElement), 'the problem leads to its field');
    await field.fill('2.2');
    await page
      .getByRole('status', { name: 'Problems of this form' })
      .getByText(/No problems|warning/)
      .first()
      .waitFor();
    page.expected.delete(400);
  });

  it('revises the patient: a new revision, the old one kept, the difference field by field', async () => {
    await page.keyboard.press('Control+s');
    await page.getByText('was saved as revision 2').waitFor();
    await page.getByRole('link', { name: 'Revisions' }).click();
    const changes = page.getByRole('region', { name: '1 change from revision 1 to 2' });
    await changes.waitFor();
    assert.match(await changes.innerText(), /Layer 3, cutting force\s+.*changed\s+1\.6 N\s+2\.2 N/s);
    await accessible(page, 'the revisions');
    const { layers } = (await api(page, 'profiles/knee-autumn?revision=1')).json;
    assert.equal(layers[2].cutting_force_n, 1.6);
    assert.deepEqual(
      layers.map((l) => l.name),
      [undefined, undefined, undefined, undefined, 'suprapatellar recess', 'femur'],
    );
  });

  it('builds a course and assigns it to the class', async () => {
    await open(page, t.lab, '#/courses-new', 'New course');
    await page.getByLabel('Id', { exact: true }).fill('autumn-course');
    await page.getByLabel('Name', { exact: true }).fill('Autumn course');
    for (const [name, patient] of [
      ['Ball first', 'phantom-ball'],
      ['Knee', 'knee-autumn'],
    ]) {
      await page.getByRole('button', { name: 'Add an exercise' }).click();
      await page.getByLabel('Exercise name').fill(name);
      await page.getByLabel('Exercise id').fill(name === 'Knee' ? 'autumn-knee' : 'autumn-ball');
      await page.getByLabel('Patient', { exact: true }).selectOption(patient);
    }
    // "target reached: at least 1" becomes a length: the field says what is stored, in any unit
    const measure = page.getByLabel('Measure').first();
    await measure.selectOption('greatest_depth_m');
    assert.equal(await page.getByLabel('At least (mm)').inputValue(), '1000', 'the 1 is a metre now');
    await measure.selectOption('target_reached');
    assert.equal(
      await page
        .getByLabel(/^At least/)
        .first()
        .inputValue(),
      '1',
    );
    // the knee: at most 4 N, 3 attempts, and it comes first
    await page.getByRole('button', { name: 'Add a requirement' }).click();
    // a measure of each layer of this patient, by its name; none of a layer K
    const choice = page.getByLabel('Measure').nth(3);
    await choice.selectOption({ label: 'Peak force in femur' });
    await page
      .getByLabel(/^At most \(N\)/)
      .nth(0)
      .waitFor();
    assert.deepEqual((await choice.innerText()).match(/^.*(?:layer K|_K_).*$/gm), null);
    await choice.selectOption('peak_force_n');
    await page
      .getByLabel(/^At most/)
      .nth(3)
      .fill('6');
    await page.getByLabel(/^Attempts/).fill('3');
    // a planned line: without a direction it is incomplete, and the link of the problem leads to the vector
    await page.getByLabel('A planned entry and line').check();
    await page.getByLabel('Direction z').fill('0');
    await page.getByRole('button', { name: 'Exercise 2, direction' }).click();
    assert.equal(await page.getByLabel('Direction x').evaluate((field) => field === document.activeElement), true);
    await page.getByLabel('Direction y').fill('0.5');
    await page.getByLabel('Direction z').fill('-2');
    await page.getByRole('button', { name: '2. Knee' }).press('Alt+ArrowUp');
    await page.getByRole('button', { name: '1. Knee' }).waitFor();
    await page.getByRole('button', { name: '2. Ball first' }).click();
    await page.getByRole('group', { name: 'Must be passed first' }).getByLabel('Knee').check();
    await accessible(page, 'the course editor');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('was saved as revision 1').waitFor();
    const { json } = await api(page, 'courses/autumn-course');
    assert.deepEqual(
      json.exercises.map((e) => [e.id, e.profile_id, e.prerequisites ?? []]),
      [
        ['autumn-knee', 'knee-autumn', []],
        ['autumn-ball', 'phantom-ball', ['autumn-knee']],
      ],
    );
    assert.deepEqual(json.exercises[0].requirements[3], { measure: 'peak_force_n', max: 6 });
    assert.deepEqual(json.exercises[0].plan, {
      frame: 'LIMB',
      entry_m: { x: 0, y: 0, z: 0 },
      direction: { x: 0, y: 0.5, z: -2 },
    });
    assert.equal(json.exercises[1].plan, undefined);

    await open(page, t.lab, '#/assignments', 'Assignments');
    await page.getByLabel('What').selectOption('course:autumn-course');
    await chooseFrom(page.getByLabel('Assign to'), 'aut', 'Group: autumn');
    await page.getByLabel('Due').fill('2031-01-05T12:00');
    await page.getByRole('button', { name: 'Assign', exact: true }).click();
    await page.getByText('Autumn course was assigned to autumn.').waitFor();
    await page.getByRole('row', { name: /Autumn course autumn/ }).waitFor();
  });

  it('watches the live page while trainees practise', async () => {
    await open(page, t.lab, '#/live', 'Live lab');
    await page.getByRole('status', { name: 'Connection' }).getByText('live').waitFor();
    // only one program can use a station's spool: wait for the end of the lesson before, on a fast machine, too
    await t.first_lesson.ended;
    stations = [
      t.lab.practise('station-1', 'anna.bauer', 'autumn-knee', [...kGood, '--seconds', '300', '--hand-repeat', '0']),
      t.lab.practise('station-2', 'ben.osei', 'autumn-knee', [
        ...kGood,
        '--hand-plan',
        'depth:0.012',
        '--seconds',
        '8',
      ]),
    ];
    const tile = page.getByRole('listitem', { name: 'Station station-1' });
    await tile.getByText('practising').waitFor();
    await tile.getByText('Anna Bauer').waitFor();
    await page.getByText('2 of 2 stations are in use').waitFor();
    // the hand goes in and out: depth and force change, and the layer at the tip is named; once to the end, so that
    // the target is reached
    const depths = new Set(),
      forces = new Set();
    let deepest = false;
    await until('one way in and out', async () => {
      const text = await tile.innerText();
      depths.add(/Depth\s+([\d.]+\s\S+)/.exec(text)?.[1]);
      forces.add(/Force\s+([\d.]+\s\S+)/.exec(text)?.[1]);
      const layer = / in (skin|fat|muscle|capsule|suprapatellar recess|femur|bone)/.exec(text)?.[1];
      deepest ||= layer === 'suprapatellar recess';
      return deepest && depths.size >= 4 && forces.size >= 4 && layer !== 'suprapatellar recess';
    });
    await accessible(page, 'the live lab');
    stations[0].child.kill('SIGTERM');
  });

  it('sees in the matrix who passed, and goes down to a session', async () => {
    for (const station of stations) assert.equal(await station.ended, 0, station.said);
    await page.getByRole('listitem', { name: 'Station station-1' }).getByText('offline').waitFor();
    await open(page, t.lab, '#/results?course=autumn-course&group=autumn', 'Results');
    const matrix = page.getByRole('region', { name: 'Results' });
    await matrix.waitFor();
    assert.equal(await matrix.getByRole('row').count(), 1 + kClass.length);
    const row = (name) => matrix.getByRole('row', { name: new RegExp(`^${name}`) });
    await row('Anna Bauer').locator('.mark-good').getByText('passed').waitFor();
    await row('Ben Osei').getByText('not passed').waitFor();
    // a trainee who has not passed the knee may not begin the ball
    await row('Ben Osei').getByText('locked').waitFor();
    await row('Li, Chen').getByText('not started').waitFor();
    assert.match(await row('Ben Osei').innerText(), /2 left/);
    await accessible(page, 'the results');
    const table = await downloaded(page, () => page.getByRole('link', { name: 'Spreadsheet (CSV)' }).click());
    assert.equal(table.name, 'autumn-course-results.csv');
    const lines = table.text.split('\r\n');
    assert.match(lines[0], /^\ufeffPerson,Full name,Groups,Exercise,Verdict,.*,Peak force \[N\](,|$)/);
    assert.ok(
      lines.some((line) => /^anna\.bauer,Anna Bauer,autumn,[^,]*,passed,/.test(line)),
      table.text,
    );
    // meanwhile a second expert practises
    expert = t.lab.practise('station-2', 'chen.li', 'autumn-knee', [
      ...kGood.slice(0, 4),
      '--hand-seed',
      '8',
      '--seconds',
      '8',
    ]);
    await row('Ben Osei')
      .getByRole('link', { name: /best session/ })
      .click();
    await page.getByRole('heading', { level: 1, name: 'Ben Osei: Knee' }).waitFor();
  });

  it('asks for the score of a session once', async () => {
    // what the page asked when it was opened is answered: only the requests of the reload are counted
    await page.getByRole('region', { name: /^Measures that were required/ }).waitFor();
    await settled(page);
    const asked = [];
    const count = (request) => /\/sessions\/[^/]+\/score$/.test(request.url()) && asked.push(request.url());
    page.on('request', count);
    await page.reload();
    await page.getByRole('region', { name: /^Measures that were required/ }).waitFor();
    await page.getByRole('group', { name: 'Force over time' }).waitFor();
    page.off('request', count);
    assert.equal(asked.length, 1, asked.join(' '));
  });

  it('reads the session: the score explains itself, plots, replay', async () => {
    await page.getByRole('heading', { name: 'Replay' }).waitFor();
    await page
      .getByText(/not passed/)
      .first()
      .waitFor();
    await page.getByText('1 of 4 requirements is not met: ').waitFor();
    const score = page.getByRole('region', { name: /^Measures that were required/ });
    await score
      .getByText(/Target not reached/i)
      .first()
      .waitFor();
    assert.match(
      await score.getByRole('row', { name: /^Peak force [\d.]+\sN/ }).innerText(),
      /^Peak force\s+[\d.]+\sN\s+at most 6\sN[\s\S]*met/,
    );
    for (const title of ['Force over time', 'Depth over time', 'Speed over time'])
      assert.ok((await page.getByRole('group', { name: title }).locator('canvas').boundingBox()).height > 100);
    // the text of the plot agrees with the server's data
    const id = page.url().split('/').at(-1);
    const samples = await api(page, `sessions/${id}/samples?points=2000`);
    const peak_N = Math.max(...samples.columns.force_n);
    const words = await page.getByText(/^Force: from .* N between/).innerText();
    assert.ok(Math.abs(Number(/to ([\d.]+) N/.exec(words)[1]) - peak_N) < 0.01, `${words} but ${peak_N} N`);

    // zooming in loads finer samples
    const plot = page.getByRole('group', { name: 'Force over time' }).locator('.u-over');
    await plot.scrollIntoViewIfNeeded();
    const box = await plot.boundingBox();
    const finer = page.waitForResponse((r) => /samples\?.*from_s=/.test(r.url()) && r.ok());
    await page.mouse.move(box.x + box.width * 0.3, box.y + 40);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width * 0.5, box.y + 45, { steps: 5 });
    await page.mouse.up();
    await finer;
    await page.getByRole('button', { name: 'Show the whole recording' }).click();

    const moment = page.getByRole('slider', { name: 'Moment' });
    await moment.fill('1');
    const before = await page.locator('.tip-now').first().getAttribute('cy');
    // slow, so that it does not end before a busy machine looks at it
    await page.getByLabel('Speed', { exact: true }).selectOption('0.25');
    await page.getByRole('button', { name: 'Play' }).click();
    await until('the replay to move on', async () => Number(await moment.inputValue()) > 1.1);
    await page.getByRole('button', { name: 'Pause' }).click();
    await moment.fill('2');
    await page.getByText(/^0:02\.0: in .* deep, /).waitFor();
    assert.notEqual(await page.locator('.tip-now').first().getAttribute('cy'), before);
    await accessible(page, 'a session');
  });

  it('shows verdict and replay first, and each value of the score once', async () => {
    assert.deepEqual(await page.locator('main h2').allInnerTexts(), [
      'Replay',
      'Score',
      'Plots',
      'Annotations',
      'Syringe',
      'Session',
    ]);
    const top = async (place) => (await place.boundingBox()).y;
    const verdict = page.getByText('1 of 4 requirements is not met: ');
    assert.ok((await top(verdict)) < (await top(page.getByRole('heading', { name: 'Replay' }))));
    await page.getByRole('slider', { name: 'Moment' }).fill('0');
    await page.getByText(/further measures$/).click();
    const id = page.url().split('/').at(-1);
    const { measures } = await api(page, `sessions/${id}/score`);
    const text = await page.locator('main').evaluate((main) => {
      const copy = main.cloneNode(true);
      copy.querySelectorAll('.visually-hidden, svg').forEach((hidden) => hidden.remove());
      copy.querySelectorAll('td, th, p, dd').forEach((cell) => cell.append('\n'));
      return copy.textContent;
    });
    const words = (row) => measureText(row.measure, row.value, row.unit, { locale: 'en-GB' });
    const shown = measures.filter((row) => row.value !== null && !isOfTissueNotMet(row)).map(words);
    // numbers with decimals and unit, which nothing else on the page has by chance
    const told = new Set(shown.filter((value) => /\d\.\d+\s\S/.test(value)));
    assert.ok(told.size > 8, shown.join('; '));
    for (const value of told) {
      const found = text
        .replaceAll('\u00a0', ' ')
        .split(new RegExp(`(?<![\\d.])${value.replaceAll('\u00a0', ' ')}(?![\\w/])`));
      assert.equal(found.length - 1, shown.filter((other) => other === value).length, value);
    }
    // nor does the list of facts repeat what the score has
    assert.doesNotMatch(await page.locator('.facts').innerText(), /passed|Length/);
    const html = await t.lab.report(id);
    assert.match(
      html,
      /<body>\s*<p class='v'>✘ not passed<\/p>\s*<h1>Ben Osei: Knee<\/h1>\s*<p>Patient: Knee, autumn course<\/p>/,
    );
    assert.ok((await printedPages(t.browser, html)) <= 2, 'the report fits two A4 pages');
  });

  it('an instructor annotates what a manager may only read', async () => {
    const address = page.url().slice(t.lab.base.length);
    assert.equal(await page.getByLabel(/^Remark at/).count(), 0, 'managers do not annotate');
    const ines = await t.browser.as('ines');
    await open(ines, t.lab, address);
    await ines.getByRole('slider', { name: 'Moment' }).fill('2.5');
    await ines.getByLabel(/^Remark at/).fill('Stopped too early: the capsule was still ahead.');
    await ines.getByRole('button', { name: /^Add at/ }).click();
    await ines.getByText('Stopped too early').waitFor();
    // others see the remark at the same place
    await page.reload();
    await page
      .getByRole('region', { name: 'Annotations' })
      .getByRole('button', { name: '0:02.5: go to this moment' })
      .click();
    const moment = page.getByRole('slider', { name: 'Moment' });
    await until('the moment of the remark', async () => Math.abs(Number(await moment.inputValue()) - 2.5) < 0.01);
    await done(ines);
  });

  it('makes experts the reference: bands and distance of the path stand beside every score', async () => {
    assert.equal(await expert.ended, 0, expert.said);
    await page.getByRole('link', { name: 'All experts of this exercise' }).click();
    await page.getByRole('heading', { level: 1, name: 'Experts of Knee' }).waitFor();
    await page.getByText('No bands yet').waitFor();
    for (const name of ['Anna Bauer', 'Li, Chen'])
      await page
        .getByRole('row', { name: new RegExp(name) })
        .getByRole('checkbox')
        .check();
    await page.getByRole('button', { name: 'Save the choice' }).click();
    const bands = page.getByRole('region', { name: /^Bands by definitions/ });
    await bands.waitFor();
    assert.match(
      await bands
        .getByRole('row', { name: /^Peak force 2\b/ })
        .first()
        .innerText(),
      /Peak force\s+2\s/,
    );
    assert.match(
      await bands.getByRole('row', { name: /^Peak force in suprapatellar recess/ }).innerText(),
      /Peak force in suprapatellar recess\s+2\s/,
    );
    await accessible(page, 'the reference');
    await page.goBack();
    // they went to the target and Ben stopped at 12 mm: their paths differ by millimetres
    const sentence = await page.getByText(/on average from the nearest expert/).innerText();
    const distance_mm = Number(/([\d.]+)\smm on average/.exec(sentence)?.[1]);
    assert.ok(distance_mm > 1 && distance_mm < 30, sentence);
    await page.getByRole('button', { name: "Score again by today's definitions" }).click();
    await page.getByText(/^Scored again, by definitions \d+\./).waitFor();
  });

  it('excuses an attempt, and lets it count again', async () => {
    await page.getByRole('button', { name: 'Excuse attempt 1 of Ben Osei' }).click();
    const dialog = page.getByRole('dialog', { name: /^Excuse attempt 1/ });
    await dialog.getByLabel('Reason').fill('The device lost its force.');
    await accessible(page, 'the excuse');
    await dialog.getByRole('button', { name: 'Excuse', exact: true }).click();
    await page.locator('.facts').getByText('does not count').waitFor();
    const left = async () =>
      (await api(page, 'results?course=autumn-course')).rows.find((r) => r.trainee === 'ben.osei').cells[0]
        .attempts_left;
    assert.equal(await left(), 3);
    await page.getByRole('button', { name: 'Let attempt 1 of Ben Osei count again' }).click();
    await page.getByRole('button', { name: 'Excuse attempt 1 of Ben Osei' }).waitFor();
    assert.equal(await left(), 2);
  });

  it('exports samples and scores as CSV with units', async () => {
    const samples = await downloaded(page, () => page.getByRole('link', { name: 'Samples as CSV' }).click());
    const lines = samples.text.trimEnd().split(/\r?\n/);
    const head = lines.find((line) => !line.startsWith('#')).split(',');
    for (const column of ['time_ns', 'fz_n', 'insertion_m', 'speed_m_s'])
      assert.ok(head.includes(column), `${column} in ${head}`);
    const id = page.url().split('/').at(-1);
    const { samples: count } = await api(page, `sessions/${id}`);
    assert.equal(lines.filter((line) => /^[\d-]/.test(line)).length, count);

    await open(page, t.lab, '#/exports', 'Exports');
    await page.getByLabel('Course').selectOption('autumn-course');
    await chooseFrom(page.getByLabel('Group'), 'autumn', 'autumn');
    const scores = await downloaded(page, () => page.getByRole('link', { name: 'Download scores as CSV' }).click());
    assert.match(scores.text, /^trainee,exercise_id,attempt,session_id,.*measure,value,unit,/);
    assert.match(scores.text, /^ben\.osei,autumn-knee,1,.*,peak_force_n,[\d.e-]+,N,,6,yes\r?$/m);
    assert.ok(!/^(tina|dora)/m.test(scores.text), 'only who has practised, only of this group');
    await accessible(page, 'the exports');
    await settled(page);
    await done(page);
  });
}

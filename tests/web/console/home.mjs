// Home: its numbers against what other requests say, the lists behind them; the menu's row; cards on a phone; a trend.
import assert from 'node:assert/strict';
import { accessible, done, fitsWidth, open, settled, single } from './browser.mjs';
import { until } from './lab.mjs';
import { api } from './week.mjs';

const kDay_ms = 86_400_000;
const kPhone = { width: 390, height: 844 };

/** Assigns by the page's own log-in. */
async function assign(page, body) {
  const status = await page.evaluate(async (json) => {
    const headers = { 'Content-Type': 'application/json' };
    headers['X-CSRF-Token'] = (await (await fetch('/api/v1/session')).json()).csrf_token;
    return (await fetch('/api/v1/assignments', { method: 'POST', headers, body: json })).status;
  }, JSON.stringify(body));
  assert.equal(status, 201);
}

/** Whether all of these stand in one line. */
const inOneLine = (locator) =>
  locator.evaluateAll((all) => {
    const boxes = all.map((one) => one.getBoundingClientRect()).filter((box) => box.width > 0);
    return Math.max(...boxes.map((box) => box.top)) < Math.min(...boxes.map((box) => box.bottom));
  });

/** Presses a number, and gives the trainees of the list behind it. */
async function behind(page, t, words) {
  await open(page, t.lab, '#/account', 'My account'); // Home asks when it is opened
  await open(page, t.lab, '#/', /^Welcome/);
  const link = page.getByRole('link', { name: words });
  const number = Number((await link.locator('.figure').innerText()).trim());
  await link.click();
  await page.getByRole('link', { name: 'Home' }).last().waitFor();
  await settled(page);
  const rows = await page.locator('.table-frame tbody tr').count();
  assert.equal(rows, number, `${words}: the list has other rows than the number says`);
  return page.locator('.table-frame tbody th').allInnerTexts();
}

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function home(t) {
  const it = single(t);

  it("a manager's numbers are those of the results, and lead to their lists", async () => {
    const page = await t.browser.as('mara');
    const [{ id }] = (await api(page, 'groups')).items.filter((g) => g.id === 'autumn');
    await assign(page, { group_id: id, course_id: 'rheumatology-basics', due_unix_ms: Date.now() - 2 * kDay_ms });
    await assign(page, { trainee: 'tina', course_id: 'rheumatology-basics', due_unix_ms: Date.now() + 3 * kDay_ms });
    const given = (await api(page, 'assignments')).items;
    const people = (await api(page, 'people?limit=500')).items;
    // by hand, from the matrix of each course: assigned to the person or one of the groups, and its cell not done
    const expected = { behind: new Set(), due: new Set() };
    for (const course of (await api(page, 'courses')).items) {
      for (const row of (await api(page, `results?course=${course.id}`)).rows) {
        const person = people.find((p) => p.name === row.trainee);
        if (!person || person.disabled) continue;
        for (const cell of row.cells) {
          const assigned = given.some(
            (a) =>
              (a.course_id === course.id || a.exercise_id === cell.exercise_id) &&
              (a.trainee === row.trainee || person.groups.includes(a.group_id)),
          );
          if (!assigned || cell.done || !cell.due_unix_ms) continue;
          if (cell.overdue) expected.behind.add(row.full_name || row.trainee);
          else if (cell.due_unix_ms <= Date.now() + 7 * kDay_ms) expected.due.add(row.full_name || row.trainee);
        }
      }
    }
    assert.ok(expected.behind.size > 1 && expected.due.has('tina'), JSON.stringify([...expected.due]));
    assert.deepEqual((await behind(page, t, /behind$/)).sort(), [...expected.behind].sort());
    assert.deepEqual((await behind(page, t, /due this week$/)).sort(), [...expected.due].sort());

    await open(page, t.lab, '#/', /^Welcome/);
    const waiting = (await api(page, 'unknown-trainees')).items.length;
    await page.getByRole('link', { name: new RegExp(`^${waiting} sessions? waits? to be confirmed$`) }).click();
    await page.getByRole('heading', { level: 1, name: 'Unknown trainees' }).waitFor();
    await done(page);
  });

  it('the stations’ numbers are those of the live lab, which shows only these', async () => {
    const page = await t.browser.as('ines');
    await open(page, t.lab, '#/', /^Welcome/);
    const link = page.getByRole('link', { name: /^\d+ stations? idle$/ });
    await link.waitFor();
    await link.click();
    await page
      .getByText(/^Shown: |Shown: \d+ idle/)
      .first()
      .waitFor();
    for (const state of await page.locator('.live-tile .mark').allInnerTexts()) assert.match(state, /idle/);
    await page.getByRole('link', { name: 'Show all' }).click();
    await until('both stations', async () => (await page.locator('.live-tile').count()) === 2);
    await done(page);
  });

  it('a trainee sees the next exercise, what failed last and the trend', async () => {
    const page = await t.browser.as('tina');
    await open(page, t.lab, '#/', /^Welcome/);
    const tile = (name) => page.locator('.tile').filter({ has: page.getByRole('heading', { name }) });
    const results = await api(page, 'results?course=rheumatology-basics');
    const next = results.rows[0].cells.find((c) => !c.passed && c.locked_by.length === 0 && c.attempts_left !== 0);
    const name = results.exercise_names[results.exercise_ids.indexOf(next.exercise_id)];
    assert.equal(await tile('Next exercise').getByRole('link').innerText(), name);
    const failed = (await api(page, 'sessions?trainee=tina&verdict=failed&limit=1')).items[0];
    assert.equal(await tile('Failed last').getByRole('link').count(), failed ? 1 : 0);
    if (failed)
      assert.match(
        await tile('Failed last').getByRole('link').getAttribute('href'),
        new RegExp(`${failed.description.session_id}$`),
      );
    const [{ exercise_id }] = (await api(page, 'people/tina/exercises')).items;
    await tile('How it goes').getByRole('link').click();
    await page.getByRole('heading', { level: 1, name: 'My progress' }).waitFor();
    assert.ok(page.url().endsWith(`exercise=${exercise_id}`), page.url());
    await done(page);
  });

  it('progress says better, as before or worse; how it was computed is shown when it is asked for', async () => {
    const page = await t.browser.as('ines');
    const [{ exercise_id }] = (await api(page, 'people/tina/exercises')).items;
    // the server's answer with values that fall clearly
    await page.route('**/people/tina/progress?*', async (route) => {
      const reply = await (await route.fetch()).json();
      const of = (better, tau, p) => ({ better, trend: { slope_per_attempt: tau, tau, p } });
      reply.measures = reply.measures.map((row) =>
        row.measure === 'peak_force_n' ? { ...row, ...of('less', -0.9, 0.001), words: 'falls by 1 N' } : row,
      );
      await route.fulfill({ json: reply });
    });
    await open(page, t.lab, `#/progress/tina?exercise=${exercise_id}&measure=peak_force_n`, /./);
    await page.locator('.judgement .mark-good').getByText('better').waitFor();
    assert.equal(await page.getByText('falls by 1 N').isVisible(), false);
    await page.getByText('How it was computed').click();
    await page.getByText('falls by 1 N').waitFor({ state: 'visible' });
    await done(page);
  });

  it('the menu is one row at 1280, and opens and closes by key', async () => {
    for (const name of ['ada', 'mara']) {
      const page = await t.browser.as(name, { viewport: { width: 1280, height: 800 } });
      await open(page, t.lab, '#/', /^Welcome/);
      assert.ok(await inOneLine(page.locator('.top > *, .top nav > ul > li')), `${name}: the menu wraps`);
      await fitsWidth(page, name);
      const more = page.getByRole('button', { name: 'More' });
      const retention = page.getByRole('navigation').getByRole('link', { name: 'Retention' });
      assert.equal(await retention.count(), 0, 'closed');
      await more.press('Enter');
      await retention.waitFor();
      await accessible(page, `the menu of ${name}`);
      await page.keyboard.press('Escape');
      await retention.waitFor({ state: 'detached' }).catch(() => {});
      assert.equal(await retention.count(), 0);
      assert.equal(await more.evaluate((e) => e === document.activeElement), true, 'the focus stays at the button');
      await more.click();
      await retention.click();
      await page.getByRole('heading', { level: 1, name: 'Retention' }).waitFor();
      assert.equal(await more.getAttribute('aria-expanded'), 'false');
      await done(page);
    }
  });

  it('on a phone the header is one line and each row of a list is a card with its columns’ names', async () => {
    const page = await t.browser.as('mara', { viewport: kPhone });
    await open(page, t.lab, '#/people', 'People');
    assert.ok(await inOneLine(page.locator('.top > *')));
    const row = page.getByRole('row', { name: /anna\.bauer/ });
    const cells = row.locator('td, th');
    const boxes = await cells.evaluateAll((all) => all.map((one) => one.getBoundingClientRect().top));
    assert.deepEqual(
      boxes,
      [...boxes].sort((a, b) => a - b),
    );
    assert.ok(new Set(boxes).size === boxes.length, 'each cell has its own line');
    const label = await cells.nth(1).evaluate((cell) => getComputedStyle(cell, '::before').content);
    assert.match(label, /Full name/);
    await fitsWidth(page, 'the people on a phone');
    await page.getByRole('button', { name: 'Menu' }).click();
    await page.getByRole('navigation').getByRole('link', { name: 'Retention' }).waitFor();
    await page.getByRole('link', { name: 'My account' }).click();
    await page.getByRole('heading', { level: 1, name: 'My account' }).waitFor();
    assert.equal(await page.getByRole('button', { name: 'Menu' }).getAttribute('aria-expanded'), 'false');
    await done(page);
  });
}

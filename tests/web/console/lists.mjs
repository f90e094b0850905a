// Long lists: fields that search, pages of lists, and that no page asks for everybody.
import assert from 'node:assert/strict';
import { accessible, chooseFrom, done, fitsWidth, kTablet, open, settled, single } from './browser.mjs';
import { until } from './lab.mjs';
import { api } from './week.mjs';

const kMany = 130;
const kFirst = 'many-000';

/** Groups many-000 to many-129 and trainees crowd.000 to crowd.129, the latter all in the first group. */
async function fill(page) {
  const problems = await page.evaluate(async (count) => {
    const headers = { 'Content-Type': 'application/json' };
    headers['X-CSRF-Token'] = (await (await fetch('/api/v1/session')).json()).csrf_token;
    const post = async (path, body) => {
      const reply = await fetch(`/api/v1/${path}`, { method: 'POST', headers, body: JSON.stringify(body) });
      return reply.ok ? [] : [await reply.text()];
    };
    const number = (i) => String(i).padStart(3, '0');
    const rows = Array.from(
      { length: count },
      (_, i) => `crowd.${number(i)},Crowd Number ${number(i)},trainee,many-000`,
    );
    const csv = ['name,full_name,role,group', ...rows].join('\n') + '\n';
    const found = await post('people/import', { csv });
    for (let i = 1; i < count; i++)
      found.push(...(await post('groups', { id: `many-${number(i)}`, name: `Many ${number(i)}`, members: [] })));
    return found;
  }, kMany);
  assert.deepEqual(problems, []);
}

/** Addresses of lists that the page asks for. */
function lists(page) {
  const asked = [];
  page.on('request', (r) => /\/api\/v1\/(people|groups|assignments)(\?|$)/.test(r.url()) && asked.push(r.url()));
  return asked;
}

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function longLists(t) {
  const it = single(t);

  it('a field that searches: arrows, Enter and Escape, and what a screen reader is told', async () => {
    const page = await t.browser.as('mara', { viewport: kTablet });
    await fill(page);
    await open(page, t.lab, '#/assignments', 'Assignments');
    const field = page.getByLabel('Assign to');
    const options = page.getByRole('listbox', { name: 'Suggestions' }).getByRole('option');
    const active = async () => page.locator(`[id="${await field.getAttribute('aria-activedescendant')}"]`).innerText();
    assert.equal(await field.getAttribute('aria-expanded'), 'false');
    await field.focus();
    await page.keyboard.type('crowd number 12');
    await page.getByText('10 to choose from').waitFor();
    assert.equal(await field.getAttribute('aria-expanded'), 'true');
    assert.equal(await options.count(), 10);
    assert.equal(await active(), 'Crowd Number 120 (crowd.120)');
    await page.keyboard.press('ArrowDown');
    await page.keyboard.press('ArrowDown');
    assert.equal(await active(), 'Crowd Number 122 (crowd.122)');
    assert.equal(await options.nth(2).getAttribute('aria-selected'), 'true');
    await page.keyboard.press('ArrowUp');
    await accessible(page, 'a field that searches');
    await fitsWidth(page, 'a field that searches');
    await page.keyboard.press('Enter');
    assert.equal(await field.inputValue(), 'Crowd Number 121 (crowd.121)');
    assert.equal(await options.count(), 0);
    // text typed over it is not a choice: nothing is assigned, the field says what is missing
    await field.fill('crowd');
    await page.getByText('The first 20 matches: type more of the name').waitFor();
    await page.keyboard.press('Escape');
    assert.equal(await options.count(), 0);
    await page.getByLabel('What').selectOption('exercise:knee-recess');
    await page.getByRole('button', { name: 'Assign', exact: true }).click();
    assert.match(await field.evaluate((e) => e.validationMessage), /^Choose one/);
    await field.fill('nobody has this');
    await page.getByText('Nothing matches “nobody has this”').waitFor();
    // groups before people, each by id or name
    await chooseFrom(field, 'many-07', 'Group: Many 077 (many-077)');
    await page.getByRole('button', { name: 'Assign', exact: true }).click();
    await page.getByText('Knee phantom: suprapatellar recess was assigned to Many 077 (many-077).').waitFor();
    assert.equal(await field.inputValue(), '', 'ready for the next');
    await page.getByRole('row', { name: /Many 077/ }).waitFor();
    await done(page);
  });

  it('Escape closes what is offered, and the dialog stays', async () => {
    const page = await t.browser.as('mara');
    await page.route(/\/api\/v1\/unknown-trainees/, async (route) => {
      const items = (await api(page, 'sessions?trainee=tina')).items.slice(0, 1);
      await route.fulfill({
        json: { items: items.map((s) => ({ ...s, unknown_trainee: true, code_unchecked: false })), next_page: '' },
      });
    });
    await open(page, t.lab, '#/unknown-trainees', 'Unknown trainees');
    await page.getByRole('button', { name: /^Give to/ }).click();
    const dialog = page.getByRole('dialog', { name: 'Who is tina?' });
    const person = dialog.getByLabel('Person', { exact: true });
    await person.click();
    await dialog.getByRole('option').first().waitFor();
    await page.keyboard.press('Escape');
    await dialog.getByRole('option').first().waitFor({ state: 'detached' });
    assert.ok(await dialog.isVisible());
    // no one in particular is a choice, too
    await chooseFrom(person, 'no one', 'No one in particular (guest)');
    assert.ok(await dialog.getByRole('button', { name: 'Give the session' }).isEnabled());
    await page.keyboard.press('Escape');
    await dialog.waitFor({ state: 'detached' });
    await done(page);
  });

  it('groups come by pages and are found; a filter keeps its group until another is chosen', async () => {
    const page = await t.browser.as('mara');
    const asked = lists(page);
    await open(page, t.lab, '#/groups', 'Groups');
    const all = (await api(page, 'groups?brief=yes')).items.length;
    const rows = page.locator('tbody tr');
    await rows.nth(99).waitFor();
    assert.equal(await rows.count(), 100);
    await page.getByRole('button', { name: 'Show more' }).click();
    await rows.nth(all - 1).waitFor();
    assert.equal(await page.getByRole('button', { name: 'Show more' }).count(), 0);
    assert.match(
      await page.getByRole('row', { name: new RegExp(`^${kFirst}`) }).innerText(),
      new RegExp(`\\s${kMany}\\s`),
    );
    await page.getByLabel('Find', { exact: true }).fill('MANY 10');
    await until('the groups that fit', async () => (await rows.count()) === 10);
    await page.getByLabel('Find', { exact: true }).fill('no such group');
    await page.getByText('No group matches').waitFor();

    await open(page, t.lab, `#/results?course=rheumatology-basics&group=${kFirst}`, 'Results');
    const field = page.getByLabel('Group', { exact: true });
    assert.equal(await field.inputValue(), kFirst);
    await page.locator('caption').getByText(`100 of ${kMany} trainees`).waitFor();
    await field.fill('many 00');
    await page.keyboard.press('Tab');
    assert.equal(await field.inputValue(), kFirst, 'nothing was chosen');
    await chooseFrom(field, 'both', 'Both of us (both)');
    await page.waitForURL(/group=both/);
    await page.locator('caption').getByText('1 trainee,').waitFor();
    assert.equal(await field.inputValue(), 'Both of us (both)');
    await field.fill('');
    await page.waitForURL((url) => !url.hash.includes('group='));
    assert.deepEqual(
      asked.filter((url) => !/[?&]limit=/.test(url) && !/brief=yes$/.test(url)),
      [],
      'a list without a bound',
    );
    await done(page);
  });

  it('a group has its members, and trainees are found to join or leave', async () => {
    const page = await t.browser.as('mara');
    const asked = lists(page);
    await open(page, t.lab, `#/groups/${kFirst}`, kFirst);
    await page.getByText(`Members: ${kMany}`).waitFor();
    const present = page.getByRole('group', { name: 'Present members' }),
      found = page.getByRole('group', { name: 'Trainees' });
    assert.equal(await present.getByRole('checkbox').count(), 100);
    await page.getByRole('button', { name: 'Show more members' }).click();
    assert.equal(await present.getByRole('checkbox').count(), kMany);
    assert.equal(await found.getByRole('checkbox').count(), 50);
    await accessible(page, 'a group with many members');
    await present.getByLabel('crowd.129').uncheck();
    await page.getByText(`Members: ${kMany - 1}`).waitFor();
    assert.ok(!(await present.getByLabel('crowd.129').isChecked()), 'it can be checked again');
    await page.getByLabel('Find a trainee').fill('tina');
    await found.getByLabel(/\(tina\)$/).check();
    await page.getByLabel('Find a trainee').fill('crowd.12');
    await page.getByText('10 trainees').waitFor();
    assert.ok(!(await found.getByLabel(/\(crowd\.129\)$/).isChecked()));
    await found.getByLabel(/\(crowd\.128\)$/).uncheck();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText(`was saved: ${kMany - 1} members`).waitFor();
    const { members } = await api(page, `groups/${kFirst}`);
    assert.equal(members.length, kMany - 1);
    assert.ok(members.includes('tina') && !members.includes('crowd.128') && !members.includes('crowd.129'));
    assert.ok(asked.every((url) => /limit=50/.test(url)) && asked.length > 0, asked.join(' '));
    await done(page);
  });

  it('progress asks for the attempts at one exercise, newest first', async () => {
    const page = await t.browser.as('ines');
    const asked = [];
    page.on('request', (r) => r.url().includes('/people/tina/') && asked.push(r.url()));
    await open(page, t.lab, '#/progress/tina', /./);
    const tried = (await api(page, 'people/tina/exercises')).items;
    const [{ exercise_id, attempts }] = tried;
    const { items } = await api(page, `people/tina/progress?exercise=${exercise_id}`);
    assert.equal(items.length, attempts);
    await page.locator('caption').getByText(`${attempts} attempt`).waitFor();
    assert.equal(await page.getByLabel('Exercise', { exact: true }).inputValue(), exercise_id);
    assert.deepEqual(
      await page.locator('.table-frame tbody th').allInnerTexts(),
      items.map((a) => `Attempt ${a.number}`).reverse(),
    );
    await settled(page);
    const own = asked.filter((url) => !/exercise=[^&]*$|exercises$/.test(url));
    assert.equal(own.length, 1, asked.join(' '));
    assert.match(own[0], new RegExp(`exercise=${exercise_id}&newest_first=yes`));
    await done(page);
  });
}

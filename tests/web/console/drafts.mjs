// What was typed and not saved: it is back after Back, a link of the menu and a reload, until it is saved or discarded or
// the person logs out. And numbers that may mean two.
import assert from 'node:assert/strict';
import { confirmed, done, logIn, open, painted, settled, single, unfold } from './browser.mjs';
import { api } from './week.mjs';

const kBack = 'Your draft is back.';
const kept = (page) => page.evaluate(() => Object.keys(sessionStorage));

export function drafts(t) {
  const test = single(t);
  const list = 'name,full_name\n' + Array.from({ length: 40 }, (_, i) => `draft.${i},Draft ${i}`).join('\n');

  test('a pasted list is back after Back and Forward, and gone once it is imported', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/people', 'People');
    await page.getByRole('link', { name: 'Import from CSV' }).click();
    const field = page.getByLabel('The list');
    await field.fill(list);
    await page.goBack();
    await page.getByRole('heading', { level: 1, name: 'People', exact: true }).waitFor();
    await page.goForward();
    await page.getByText(kBack).waitFor();
    assert.equal(await field.inputValue(), list);
    await page.getByRole('button', { name: 'Check' }).click();
    await page.getByRole('button', { name: 'Import', exact: true }).click();
    await page.getByText('✓ Imported:').waitFor();
    await page.getByText(kBack).waitFor({ state: 'detached' });
    assert.deepEqual(await kept(page), []);
    await page.goBack();
    await page.goForward();
    assert.equal(await field.inputValue(), '');
    await done(page);
  });

  test('ticked members are back after a link and a reload; another revision meanwhile is a conflict', async () => {
    const page = await t.browser.as('mara');
    page.expected.add(409);
    await page.goto(t.lab.base + '#/groups');
    await page.getByRole('button', { name: 'Add a group' }).click();
    const dialog = page.getByRole('dialog', { name: 'Add a group' });
    await painted(dialog);
    await dialog.getByLabel('Id').fill('drafted');
    // a dialog that was left has its entries again
    await page.goto(t.lab.base + '#/people');
    await page.goto(t.lab.base + '#/groups');
    await page.getByRole('button', { name: 'Add a group' }).click();
    await painted(dialog);
    await dialog.getByText(kBack).waitFor();
    assert.equal(await dialog.getByLabel('Id').inputValue(), 'drafted');
    await dialog.getByLabel('Name').fill('Drafted');
    await dialog.getByRole('button', { name: 'Add', exact: true }).click();
    await page.getByRole('heading', { level: 1, name: 'Drafted' }).waitFor();
    assert.deepEqual(await kept(page), []);

    const trainees = page.getByRole('group', { name: 'Trainees' });
    await page.getByLabel('Find a trainee').fill('draft.1');
    for (const n of [1, 10, 11]) await trainees.getByLabel(`(draft.${n})`).check();
    await page.getByRole('link', { name: 'Courses' }).click();
    await page.getByRole('heading', { level: 1, name: 'Courses' }).waitFor();
    await page.goBack();
    await page.getByText(kBack).waitFor();
    await page.reload();
    await page.getByText(kBack).waitFor();
    const members = page.getByRole('group', { name: 'Present members' }).getByRole('checkbox', { checked: true });
    assert.equal(await members.count(), 3);
    // meanwhile another person adds one: the draft is of the revision before
    const other = await t.browser.as('milo');
    await open(other, t.lab, '#/groups/drafted', 'Drafted');
    await other.getByLabel('Find a trainee').fill('draft.2');
    await other.getByRole('group', { name: 'Trainees' }).getByLabel('(draft.2)', { exact: false }).first().check();
    await other.getByRole('button', { name: 'Save', exact: true }).click();
    await other.getByText('Drafted was saved: 1 member.').waitFor();
    await done(other);
    await page.reload();
    await page.getByText(kBack).waitFor();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    const conflict = page.getByRole('dialog', { name: 'Someone else saved first' });
    await painted(conflict);
    await conflict.getByRole('button', { name: 'Merge and keep editing' }).click();
    await page.reload();
    await page.getByText(kBack).waitFor();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('Drafted was saved: 4 members.').waitFor();
    await page.getByText(kBack).waitFor({ state: 'detached' });
    assert.deepEqual((await api(page, 'groups/drafted')).members.sort(), [
      'draft.1',
      'draft.10',
      'draft.11',
      'draft.2',
    ]);
    assert.deepEqual(await kept(page), []);
    await done(page);
  });

  test("a person's data are back without the password, and gone at the log-out", async () => {
    const page = await t.browser.window();
    await page.goto(t.lab.base);
    await logIn(page, 'mara');
    await open(page, t.lab, '#/people/tina');
    await page.getByLabel('Full name').fill('Tina Nielsen');
    await page.getByLabel('New password').fill('a password of hers');
    await page.getByRole('link', { name: 'People' }).first().click();
    await page.getByRole('button', { name: 'Add a person' }).click();
    const dialog = page.getByRole('dialog', { name: 'Add a person' });
    await painted(dialog);
    await dialog.getByLabel('Name', { exact: true }).fill('new.person');
    await dialog.getByLabel('Password').fill('another password');
    const all = await page.evaluate(() => JSON.stringify(sessionStorage));
    assert.match(all, /Tina Nielsen/);
    assert.match(all, /new\.person/);
    assert.doesNotMatch(all, /password/);
    await page.goto(t.lab.base + '#/people/tina');
    await page.getByText(kBack).waitFor();
    assert.equal(await page.getByLabel('Full name').inputValue(), 'Tina Nielsen');
    assert.equal(await page.getByLabel('New password').inputValue(), '');
    await confirmed(page, page.getByRole('button', { name: 'Discard the draft' }), 'Discard');
    await page.getByText(kBack).waitFor({ state: 'detached' });
    assert.equal(await page.getByLabel('Full name').inputValue(), '');
    await page.getByLabel('Full name').fill('Tina Nielsen');
    await page.getByRole('button', { name: 'Log out' }).click();
    await page.getByRole('button', { name: 'Log in' }).waitFor();
    assert.deepEqual(await kept(page), []);
    await logIn(page, 'mara');
    await settled(page);
    assert.equal(await page.getByLabel('Full name').inputValue(), '');
    await done(page);
  });

  test('1,200 in English and 1.200 in German are asked about once, and the answer is stored', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/profiles/shoulder-adult');
    await unfold(page);
    const field = page.getByLabel('Wall stiffness (N/m)');
    const save = page.getByRole('button', { name: 'Save', exact: true });
    await field.fill('1,200');
    const question = page.locator('.field-problem', { hasText: '“1,200” may be 1.2 or 1200' });
    await question.waitFor();
    assert.ok(await save.isDisabled(), 'nothing is stored before the answer');
    await question.getByRole('button', { name: '1200 N/m' }).click();
    await question.waitFor({ state: 'detached' });
    assert.equal(await field.inputValue(), '1200');
    assert.ok(await field.evaluate((f) => f === document.activeElement), 'the focus is in the field again');
    await save.click();
    await page.getByText(/was saved as revision/).waitFor();
    const { json } = await api(page, 'profiles/shoulder-adult');
    assert.equal(json.tracking_wall.stiffness_n_per_m, 1200);
    await done(page);

    const german = await t.browser.as('ada', { locale: 'de-DE' });
    await open(german, t.lab, '#/retention');
    await german.getByLabel(/^Coarser steps/).fill('1,2');
    await german.getByLabel(/^Delete after/).fill('1.200');
    assert.equal(await german.getByText('which is it?').count(), 0, 'neither is a question: no day is 1.2');
    await german.getByLabel(/^Thin out after/).fill('1.000');
    await german.getByText('“1.000” may be 1 or 1000: which is it?').waitFor();
    await german.getByRole('button', { name: '1000 days' }).click();
    await german.getByLabel(/^Samples left/).fill('١٠٠');
    await german.getByRole('button', { name: 'Save the policy' }).click();
    await german.getByText(/^Retention of .* was saved/).waitFor();
    const [policy] = (await api(german, 'retention')).policies;
    const { thin_after_days, thin_rate_hz, thin_coarser, delete_after_days } = policy;
    assert.deepEqual([thin_after_days, thin_rate_hz, thin_coarser, delete_after_days], [1000, 100, 1.2, 1200]);
    await done(german);
  });
}

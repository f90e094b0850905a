// Keeping the lab's data: consent and studies, retention, backup, scoring again, the audit, a person's own data.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import {
  accessible,
  chooseFrom,
  confirmed,
  done,
  downloaded,
  open,
  painted,
  pressedWhileItOpens,
  settled,
  single,
} from './browser.mjs';
import { api } from './week.mjs';

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function upkeep(t) {
  const it = single(t);
  it('only who consents is in a study, and by a pseudonym', async () => {
    const [rhea, tina] = [await t.browser.as('rhea'), await t.browser.as('tina')];
    const exported = async (study) => {
      await rhea.getByLabel('Study', { exact: true }).fill(study);
      const file = await downloaded(rhea, () => rhea.getByRole('button', { name: 'Download the study' }).click());
      await rhea
        .getByRole('status')
        .getByText(/✓ \d+ (person|people)/)
        .waitFor();
      return file.text
        .trimEnd()
        .split('\n')
        .map((line) => JSON.parse(line));
    };
    await open(rhea, t.lab, '#/exports', 'Exports');
    assert.equal((await exported('before'))[0].people, 0);
    await open(tina, t.lab, '#/account', 'My account');
    await tina.getByLabel('Recordings may be used in studies').check();
    await tina.getByText('Consent was recorded.').waitFor();
    const records = await exported('after');
    assert.equal(records[0].people, 1);
    assert.ok(records[0].sessions >= 1);
    assert.ok(!records.some((r) => JSON.stringify(r).includes('tina')), 'the name is in the export');
    await accessible(rhea, 'the exports as a researcher');
    await done(rhea);
    await done(tina);
  });

  it('a person gets everything that is stored of it', async () => {
    const tina = await t.browser.as('tina');
    await open(tina, t.lab, '#/account', 'My account');
    const thing = tina
      .getByRole('button', { name: 'Download as JSON' })
      .or(tina.getByRole('link', { name: 'Download as JSON' }));
    const file = await downloaded(tina, () => thing.click());
    assert.equal(file.name, 'tina.json');
    const kept = JSON.parse(file.text);
    const kinds = new Set((kept.items ?? kept.records ?? kept).map((r) => r.kind));
    for (const kind of ['person', 'session', 'consent']) assert.ok(kinds.has(kind), `${kind} in ${[...kinds]}`);
    await done(tina);
  });

  it('one more person: added, refused twice, disabled, renamed, and gone with all data', async () => {
    const page = await t.browser.as('ada');
    page.expected.add(400).add(409);
    await open(page, t.lab, '#/people', 'People');
    const add = async () => {
      await page.getByRole('button', { name: 'Add a person' }).click();
      const dialog = page.getByRole('dialog', { name: 'Add a person' });
      await dialog.getByLabel('Name', { exact: true }).fill('gina.gone');
      await dialog.getByLabel('Full name').fill('Gina Gone');
      await dialog.getByLabel('Password').fill('a long enough password');
      await dialog.getByRole('button', { name: 'Add' }).click();
      return dialog;
    };
    await add();
    await page.getByText('gina.gone was added.').waitFor();
    const again = await add();
    await again.getByText("there is already a person named 'gina.gone'").waitFor();
    await page.keyboard.press('Escape');

    await page.getByRole('link', { name: 'gina.gone' }).click();
    await confirmed(page, page.getByRole('button', { name: 'Disable' }), 'Disable');
    await page.getByText('gina.gone is disabled.').waitFor();
    const gina = await t.browser.window();
    await gina.goto(t.lab.base);
    await gina.getByLabel('Name').fill('gina.gone');
    await gina.getByLabel('Password').fill('a long enough password');
    await gina.getByRole('button', { name: 'Log in' }).click();
    await gina.getByText(/password is wrong, or this person is disabled/).waitFor();
    await done(gina);

    const { id } = await api(page, 'people/gina.gone');
    await page.getByLabel('Account').fill('gina.leaving');
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByRole('heading', { name: 'gina.leaving' }).waitFor();
    assert.equal((await api(page, 'people/gina.leaving')).id, id);

    await open(page, t.lab, '#/groups', 'Groups');
    await page.getByRole('button', { name: 'Add a group' }).click();
    const group = page.getByRole('dialog', { name: 'Add a group' });
    await group.getByLabel('Id').fill('hers');
    await group.getByLabel('Name').fill('Friends of Gina Gone');
    await painted(group);
    await page.keyboard.press('Enter');
    await page.getByRole('heading', { level: 1, name: 'Friends of Gina Gone' }).waitFor();
    await open(page, t.lab, '#/people/gina.leaving', 'gina.leaving');
    await page.getByRole('button', { name: 'Find texts that name the person' }).click();
    await page.getByRole('link', { name: "the name of group 'hers'" }).waitFor();
    await confirmed(page, page.getByRole('button', { name: 'Remove the name from group hers' }), 'Redact');
    await page.getByText("The name was removed from the name of group 'hers'.").waitFor();
    assert.equal((await api(page, 'groups/hers')).name, 'Friends of [name removed]');

    await page.getByRole('button', { name: 'Erase all data …' }).click();
    const dialog = page.getByRole('dialog', { name: /^Erase all data of gina/ });
    const erase = dialog.getByRole('button', { name: 'Erase for good' });
    await dialog.getByLabel('Name').fill('gina');
    assert.ok(await erase.isDisabled(), 'half a name is not a confirmation');
    await dialog.getByLabel('Name').fill('gina.leaving');
    await dialog.getByLabel('Reason').fill('asked for it');
    await dialog.getByLabel(/^Also sessions that wait for a manager/).check();
    await erase.click();
    await page.getByText('The data of gina.leaving were erased.').waitFor();
    const { items } = await api(page, 'audit');
    assert.ok(!items.some((line) => JSON.stringify(line).includes('gina')), 'the name still stands in the audit');
    assert.ok(!(await api(page, 'people')).items.some((p) => p.name === 'gina.leaving'));
    await done(page);
  });

  it('takes an assignment back, and an older revision of a patient up again', async () => {
    const page = await t.browser.as('milo');
    await open(page, t.lab, '#/assignments', 'Assignments');
    await page.getByLabel('What').selectOption('exercise:knee-recess');
    await chooseFrom(page.getByLabel('Assign to'), 'tin', 'tina');
    await page.getByRole('button', { name: 'Assign', exact: true }).click();
    await page.getByText('Knee phantom: suprapatellar recess was assigned to tina.').waitFor();
    const ask = page.getByRole('button', { name: 'Withdraw Knee phantom: suprapatellar recess from tina' }),
      dialog = page.getByRole('dialog');
    // Enter leaves everything as it is, and what is pressed before the question is to be seen answers nothing
    await pressedWhileItOpens(page, () => ask.click(), ['Tab', 'Enter', 'Enter', 'Escape']);
    await painted(dialog);
    assert.equal(await page.evaluate(() => document.activeElement?.textContent), 'Cancel');
    await page.keyboard.press('Enter');
    await dialog.waitFor({ state: 'detached' });
    await ask.click();
    await dialog.getByRole('button', { name: 'Withdraw' }).click();
    await page.getByText('The assignment was withdrawn.').waitFor();
    assert.deepEqual(
      (await api(page, 'assignments?trainee=tina')).items.filter((a) => a.exercise_id === 'knee-recess'),
      [],
    );

    await open(page, t.lab, '#/profiles/wrist-adult/revisions', /^Revisions of/);
    await page.getByRole('button', { name: 'Save as the newest: revision 1' }).click();
    await page.getByText(/^Revision 1 was saved again, as revision 4/).waitFor();
    const [first, now] = [await api(page, 'profiles/wrist-adult?revision=1'), await api(page, 'profiles/wrist-adult')];
    assert.equal(now.revision, 4);
    assert.deepEqual(now.json, first.json);
    await done(page);
  });

  it('retention: a policy is set, what would happen is shown, and it is taken away again', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/retention', 'Retention');
    await page.getByText('No policy is set').waitFor();
    await page.getByLabel('Exercise').selectOption('knee-recess');
    await page.getByLabel(/^Thin out after/).fill('30');
    await page.getByText('how many samples a second are left').waitFor();
    assert.ok(await page.getByRole('button', { name: 'Save the policy' }).isDisabled());
    await page.getByLabel(/^Samples left/).fill('100');
    await page.getByLabel(/^Delete after/).fill('10');
    await page.getByText('later than the thinning').waitFor();
    await page.getByLabel(/^Delete after/).fill('365');
    await page.getByRole('button', { name: 'Save the policy' }).click();
    const row = page.getByRole('row', { name: /suprapatellar/ });
    await row.waitFor();
    assert.match(await row.innerText(), /after 30 days: to 100 samples a second\s+after 365 days\s+waits\s+mara/);
    const [policy] = (await api(page, 'retention')).policies;
    assert.deepEqual(
      [
        policy.exercise_id,
        policy.thin_after_days,
        policy.thin_rate_hz,
        policy.delete_after_days,
        policy.without_backup,
      ],
      ['knee-recess', 30, 100, 365, false],
    );
    await page.getByRole('button', { name: 'Show what would happen' }).click();
    await page
      .getByRole('status')
      .getByText(/0 thinned, 0 deleted, 0 wait/)
      .waitFor();
    assert.ok(await page.getByRole('button', { name: /^Run now/ }).isDisabled(), 'there is nothing to do');
    await accessible(page, 'retention');
    await confirmed(page, row.getByRole('button', { name: /^Remove/ }), 'Remove');
    await page.getByText('No policy is set').waitFor();
    await done(page);
  });

  it('a session of a name that no one has is given to the right person', async () => {
    // a lesson without the server: the exercise is in the station's cache
    const alone = t.lab.start(
      'needlelab-station',
      [
        ...['--key', t.lab.path('station-2.key'), '--spool', t.lab.path('spool-station-2')],
        ...['--trainee', 'tino', '--exercise', 'knee-recess', '--device', 'simulated', '--headless', '--seconds', '1'],
      ],
      'alone.log',
    );
    assert.equal(await alone.ended, 0, alone.said);
    // with the server the name is refused, and a similar one suggested; the next lesson brings what was recorded
    const refused = t.lab.practise('station-2', 'tino', 'knee-recess', ['--seconds', '1']);
    assert.equal(await refused.ended, 1, refused.said);
    assert.match(refused.said, /no one named 'tino' who may practise\. Did you mean 'tina'/);
    const next = t.lab.practise('station-2', 'guest', 'knee-recess', ['--seconds', '1', '--drain', '60']);
    assert.equal(await next.ended, 0, next.said);

    const page = await t.browser.as('mara');
    page.expected.add(500);
    const people = /\/api\/v1\/people(\?|$)/;
    const body = JSON.stringify({ error: { code: 'FAILED', message: 'the disk is full' } });
    await page.route(people, (route) => route.fulfill({ status: 500, contentType: 'application/json', body }));
    await open(page, t.lab, '#/unknown-trainees', 'Unknown trainees');
    const give = page.getByRole('button', { name: 'Give to … the session of tino' });
    assert.equal(await page.getByRole('button', { name: /^Confirm/ }).count(), 0, 'there is no tino to confirm');
    await give.click();
    const dialog = page.getByRole('dialog', { name: 'Who is tino?' });
    const person = dialog.getByLabel('Person', { exact: true });
    // without the people no one can be chosen: the field says so
    await person.fill('tina');
    await page.getByText('No one can be chosen: the people could not be loaded').waitFor();
    assert.ok(await dialog.getByRole('button', { name: 'Give the session' }).isDisabled());
    await page.unroute(people);
    await page.getByRole('button', { name: 'Try again' }).click();
    await page.getByText('No one can be chosen').waitFor({ state: 'detached' });
    await page.getByRole('option', { name: 'tina', exact: true }).click();
    await dialog.getByLabel('Reason').fill('A typing error.');
    await accessible(page, 'an unknown trainee');
    // another manager looks at the same session meanwhile
    const late = await t.browser.as('milo');
    await open(late, t.lab, '#/unknown-trainees', 'Unknown trainees');
    await late.getByRole('button', { name: /^Give .*session of tino/ }).click();
    await dialog.getByRole('button', { name: 'Give the session' }).click();
    await page.getByText('No sessions are waiting').waitFor();
    // the late one is refused: the page says whose the session is now, and keeps what was entered
    late.expected.add(409);
    const too_late = late.getByRole('dialog', { name: 'Who is tino?' });
    await chooseFrom(too_late.getByLabel('Person', { exact: true }), 'mara', 'mara');
    await too_late.getByLabel('Reason').fill('A guess.');
    await too_late.getByRole('button', { name: 'Give the session' }).click();
    await too_late.getByRole('alert').getByText("was given to 'tina' meanwhile, not 'tino': look at it").waitFor();
    assert.equal(await too_late.getByLabel('Reason').inputValue(), 'A guess.');
    assert.deepEqual((await api(late, 'sessions?trainee=mara')).items, []);
    await done(late);
    const { items } = await api(page, 'sessions?trainee=tina');
    const given = items.find((s) => s.given_trainee === 'tino');
    await open(page, t.lab, `#/sessions/${given.description.session_id}`, /^tina: /);
    await page.getByText('tina; the station named tino, a manager assigned it').waitFor();
    await done(page);
  });

  it('a code is given and shown once; a session for which nobody gave it is confirmed', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/people/tina', 'tina');
    await page.getByRole('button', { name: 'Give a code' }).click();
    const dialog = page.getByRole('dialog', { name: 'A new code' });
    assert.match(await dialog.getByLabel('PIN of tina').innerText(), /^\d{6}$/);
    await accessible(page, 'a new code');
    await dialog.getByRole('button', { name: 'Close' }).click();
    await page.getByText('has a code').waitFor();
    await open(page, t.lab, '#/people', 'People');
    assert.match(await page.getByRole('row', { name: /^tina/ }).innerText(), /has one/);

    // with the server no lesson begins without it; without the server one does, and waits
    const refused = t.lab.practise('station-2', 'tina', 'knee-recess', ['--seconds', '1']);
    assert.equal(await refused.ended, 2, refused.said);
    assert.match(refused.said, /tina has a code/);
    const alone = t.lab.start(
      'needlelab-station',
      [
        ...['--key', t.lab.path('station-2.key'), '--spool', t.lab.path('spool-station-2')],
        ...['--trainee', 'tina', '--exercise', 'knee-recess', '--device', 'simulated', '--headless', '--seconds', '1'],
      ],
      'alone-with-code.log',
    );
    assert.equal(await alone.ended, 0, alone.said);
    const next = t.lab.practise('station-2', 'guest', 'knee-recess', ['--seconds', '1', '--drain', '60']);
    assert.equal(await next.ended, 0, next.said);
    const counted = async () => (await api(page, 'people/tina/progress')).items.length;
    const before = await counted();
    await open(page, t.lab, '#/unknown-trainees', 'Unknown trainees');
    await page.getByText('the code was not given').waitFor();
    await accessible(page, 'a session without a code');
    await page.getByRole('button', { name: 'Confirm the session of tina' }).click();
    await page.getByText('No sessions are waiting').waitFor();
    assert.equal(await counted(), before + 1);
    const known = (await api(page, 'sessions?trainee=tina')).items.find((s) => s.given_trainee === 'tina');
    await open(page, t.lab, `#/sessions/${known.description.session_id}`, /^tina: /);
    await page.getByText('tina; the station named tina, a manager confirmed it').waitFor();

    await open(page, t.lab, '#/people/tina', 'tina');
    const badge = page.getByLabel('Badge or PIN');
    assert.equal(await badge.getAttribute('autocomplete'), 'new-password', 'no browser fills in the log-in');
    await badge.fill('0007');
    await page.getByRole('button', { name: 'Set the code' }).click();
    await page.getByText('The code of tina was set.').waitFor();
    // Enter leaves it
    const question = page.getByRole('dialog', { name: 'Remove the code of tina?' });
    await page.getByRole('button', { name: 'Remove code' }).click();
    await painted(question);
    assert.equal(await page.evaluate(() => document.activeElement?.textContent), 'Cancel');
    await page.keyboard.press('Enter');
    await question.waitFor({ state: 'detached' });
    assert.equal((await api(page, 'people/tina')).has_code, true);
    await confirmed(page, page.getByRole('button', { name: 'Remove code' }), 'Remove');
    await page.getByText('tina no longer has a code.').waitFor();
    assert.equal((await api(page, 'people/tina')).has_code, false);
    await done(page);

    const ada = await t.browser.as('ada');
    await open(ada, t.lab, '#/upkeep', 'Upkeep');
    const required = ada.getByLabel('Codes are required');
    // the box follows the server's answer, not the click
    await required.click();
    await ada.getByText('Codes are required now.').waitFor();
    assert.ok(await required.isChecked());
    assert.equal((await api(ada, 'lab/settings')).codes_required, true);
    await required.click();
    await ada.getByText('Codes are optional now.').waitFor();
    assert.ok(!(await required.isChecked()));
    assert.equal((await api(ada, 'lab/settings')).codes_required, false);
    await done(ada);
  });

  it('backup and check while the lab continues; scores again; all of it in the audit', async () => {
    const page = await t.browser.as('ada');
    await open(page, t.lab, '#/upkeep', 'Upkeep');
    await page.getByText(/Room left on the disk of the database: \d/).waitFor();
    await page.getByText(/the server has confirmed survives a power cut\. .*Stations keep each recording/).waitFor();
    const copy = t.lab.path('copy.db');
    await page.getByLabel(/^File on the server/).fill(copy);
    await page.getByRole('button', { name: 'Back up now' }).click();
    await page
      .getByText(/verified.*pieces of recordings read back/s)
      .first()
      .waitFor();
    assert.ok(existsSync(copy));
    // it lies beside the database
    await page
      .getByText(/not Safe It is on (the same disk|a disk that the server does not know).*stations keep/s)
      .first()
      .waitFor();
    await page.getByRole('button', { name: 'Check now' }).click();
    await page.getByText('all is well').waitFor();
    await page.getByRole('button', { name: 'How many are there?' }).click();
    await page.getByText(/0 scored by definitions \d/).waitFor();
    // a second backup to the same file is refused, and the page says so
    page.expected.add(400).add(409).add(500);
    await page.getByRole('button', { name: 'Back up now' }).click();
    await page.getByText('No backup was made').waitFor();

    await open(page, t.lab, '#/audit?action=backup', 'Audit');
    await page
      .getByRole('row', { name: /ada\s+backup/ })
      .first()
      .waitFor();
    await page.getByRole('link', { name: 'Show all' }).click();
    await settled(page);
    for (const action of ['profile import', 'curriculum import', 'user import', 'user code', 'lab set'])
      await page.getByRole('cell', { name: action }).first().waitFor();
    await done(page);
  });
}

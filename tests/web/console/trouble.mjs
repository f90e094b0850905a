// Trouble in a lab: two managers edit at once, the server dies, a log-in ends. Nothing that was typed is lost.
import assert from 'node:assert/strict';
import { accessible, confirmed, done, open, single, unfold } from './browser.mjs';
import { kPassword } from './lab.mjs';
import { api } from './week.mjs';

const again = (page) => page.getByRole('dialog', { name: 'Log in again' });
async function logInAgain(page) {
  await again(page).getByLabel('Password').fill(kPassword);
  await again(page).getByRole('button', { name: 'Log in', exact: true }).click();
  await again(page).waitFor({ state: 'detached' });
}

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function trouble(t) {
  const it = single(t);
  it('two managers change a patient at once: both are kept, field by field', async () => {
    const [first, second] = [await t.browser.as('mara'), await t.browser.as('milo')];
    for (const page of [first, second]) {
      page.expected.add(409);
      await open(page, t.lab, '#/profiles/wrist-adult');
      await unfold(page);
      await page
        .getByLabel(/^Thickness/)
        .first()
        .waitFor();
    }
    const before = (await api(first, 'profiles/wrist-adult')).json;
    await first
      .getByLabel(/^Thickness/)
      .first()
      .fill('2.5');
    await first.getByLabel(/^Greatest force/).fill('9');
    await first.getByRole('button', { name: 'Save', exact: true }).click();
    await first.getByText('was saved as revision 2').waitFor();

    await second
      .getByLabel(/^Thickness/)
      .first()
      .fill('2.7');
    await second
      .getByLabel(/^Thickness/)
      .nth(1)
      .fill('3.3');
    await second.getByRole('button', { name: 'Save', exact: true }).click();
    const dialog = second.getByRole('dialog', { name: 'Someone else saved first' });
    await dialog.getByText('mara saved revision 2').waitFor();
    await accessible(second, 'the conflict');
    // open, put off and open again: everything is still there
    await dialog.getByRole('button', { name: 'Back, decide later' }).click();
    assert.equal(
      await second
        .getByLabel(/^Thickness/)
        .nth(1)
        .inputValue(),
      '3.3',
    );
    await second.getByRole('button', { name: 'Save', exact: true }).click();
    await dialog.getByLabel(/Keep mine for Layer 1, thickness/).check();
    await dialog.getByRole('button', { name: 'Save both together' }).click();
    await second.getByText('was saved as revision 3').waitFor();

    const { json } = await api(second, 'profiles/wrist-adult');
    assert.deepEqual([json.layers[0].thickness_m, json.layers[1].thickness_m, json.max_force_n], [0.0027, 0.0033, 9]);
    json.layers[0].thickness_m = before.layers[0].thickness_m;
    json.layers[1].thickness_m = before.layers[1].thickness_m;
    json.max_force_n = before.max_force_n;
    assert.deepEqual(json, before, 'nothing else has changed');
    assert.deepEqual(
      (await api(second, 'profiles/wrist-adult/revisions')).items.map((r) => [r.revision, r.author]).slice(0, 2),
      [
        [3, 'milo'],
        [2, 'mara'],
      ],
    );
    await done(first);
    await done(second);
  });

  it('two managers change a group at once: the name of the one and the member of the other stay', async () => {
    const [first, second] = [await t.browser.as('mara'), await t.browser.as('milo')];
    second.expected.add(409);
    await open(first, t.lab, '#/groups', 'Groups');
    await first.getByRole('button', { name: 'Add a group' }).click();
    await first.getByRole('dialog').getByLabel('Id').fill('both');
    await first.getByRole('dialog').getByLabel('Name').fill('Both');
    await first.getByRole('dialog').getByRole('button', { name: 'Add' }).click();
    await first.getByRole('heading', { level: 1, name: 'Both' }).waitFor();
    await open(second, t.lab, '#/groups/both', 'Both');
    await first.getByLabel('Name', { exact: true }).fill('Both of us');
    await first.getByRole('button', { name: 'Save', exact: true }).click();
    await first.getByText(/Both of us was saved/).waitFor();
    await second.getByLabel(/\(tina\)$/).check();
    await second.getByRole('button', { name: 'Save', exact: true }).click();
    const dialog = second.getByRole('dialog', { name: 'Someone else saved first' });
    await dialog.getByText('Both of us').first().waitFor();
    await dialog.getByRole('button', { name: 'Save both together' }).click();
    await second.getByText(/was saved: 1 members?/).waitFor();
    const { name, members } = await api(first, 'groups/both');
    assert.deepEqual([name, members], ['Both of us', ['tina']]);
    await done(first);
    await done(second);
  });

  it('a log-in that ended is asked for above the page, and the save continues', async () => {
    const page = await t.browser.as('milo');
    await open(page, t.lab, '#/profiles/shoulder-frail');
    await unfold(page);
    await page.getByLabel('Name', { exact: true }).first().fill('Shoulder, very frail');
    // a new password ends every log-in of that person at once
    const ada = await t.browser.as('ada');
    await open(ada, t.lab, '#/people/milo', 'milo');
    await ada.getByLabel('New password').fill(kPassword);
    await ada.getByLabel('Repeat password').fill(kPassword);
    await ada.getByRole('button', { name: 'Set the password' }).click();
    await ada.getByText('The password was set.').waitFor();

    await page.keyboard.press('Control+s');
    await again(page).waitFor();
    assert.equal(await again(page).getByLabel('Name').inputValue(), 'milo');
    await accessible(page, 'the log-in above a page');
    await again(page).getByLabel('Password').fill('not this one');
    await again(page).getByRole('button', { name: 'Log in', exact: true }).click();
    await again(page)
      .getByText(/password is wrong/)
      .waitFor();
    await logInAgain(page);
    await page.getByText('was saved as revision 2').waitFor();
    assert.equal((await api(page, 'profiles/shoulder-frail')).json.name, 'Shoulder, very frail');
    await done(page);
    await done(ada);
  });

  it('a server that was killed and comes back: the banner, what was typed, the live page, and the lesson under way', async () => {
    const [page, live] = [await t.browser.as('mara'), await t.browser.as('ines')];
    await open(live, t.lab, '#/live', 'Live lab');
    const line = live.getByRole('status', { name: 'Connection' });
    await line.getByText('live').waitFor();
    const lesson = t.lab.practise('station-1', 'tina', 'knee-recess', [
      '--hand-repeat',
      '0',
      '--seconds',
      '300',
      '--drain',
      '60',
    ]);
    const tile = live.getByRole('listitem', { name: 'Station station-1' });
    await tile.getByText('practising').waitFor();
    await open(page, t.lab, '#/profiles/shoulder-adult');
    await unfold(page);
    await page
      .getByLabel(/^Thickness/)
      .first()
      .fill('3.2');
    for (const one of [page, live]) {
      one.line_may_break = true;
      one.expected.add(502);
    }

    await t.lab.killServer();
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await page.getByText('The server cannot be reached.').waitFor();
    await line.getByText('interrupted').waitFor();
    await accessible(page, 'a page without a server');
    await t.lab.startServer();

    // log-ins do not survive the server: the console asks for a new one, also on the live page
    await page.getByText('The server cannot be reached.').waitFor({ state: 'detached' });
    assert.equal(
      await page
        .getByLabel(/^Thickness/)
        .first()
        .inputValue(),
      '3.2',
    );
    await page.getByRole('button', { name: 'Save', exact: true }).click();
    await logInAgain(page);
    await page.getByText('was saved as revision 2').waitFor();
    assert.equal((await api(page, 'profiles/shoulder-adult')).json.layers[0].thickness_m, 0.0032);
    await again(live).waitFor();
    await logInAgain(live);
    await line.getByText('live').waitFor();
    await tile.getByText('practising').waitFor();

    lesson.child.kill('SIGTERM');
    assert.equal(await lesson.ended, 0, lesson.said);
    const [session] = (await api(live, 'sessions?trainee=tina')).items;
    assert.equal(session.state, 'SESSION_COMPLETE', 'the server has the whole lesson, from before and after');
    await done(page);
    await done(live);
  });

  it('a page that was closed while something was typed has it again', async () => {
    const page = await t.browser.as('mara');
    await open(page, t.lab, '#/profiles/shoulder-muscular');
    await unfold(page);
    await page
      .getByLabel(/^Thickness/)
      .first()
      .fill('4.4');
    await page.getByText('not saved yet').waitFor();
    page.on('dialog', (dialog) => dialog.accept());
    await page.reload();
    await page.getByText('Your draft is back.').waitFor();
    await unfold(page);
    assert.equal(
      await page
        .getByLabel(/^Thickness/)
        .first()
        .inputValue(),
      '4.4',
    );
    await confirmed(page, page.getByRole('button', { name: 'Discard changes' }), 'Discard');
    await page.getByText('not saved yet').waitFor({ state: 'detached' });
    await done(page);
  });

  it('too many wrong passwords: how long to wait is said', async () => {
    const page = await t.browser.window();
    page.expected.add(429);
    await page.goto(t.lab.base);
    // a name that no later test needs: names that do not exist are locked as well
    await page.getByLabel('Name').fill('nils');
    await page.getByLabel('Password').fill('x');
    for (let n = 0; n < 12 && !(await page.getByText(/locked for/).isVisible()); n++) {
      await page.getByLabel('Password').fill(`wrong ${n}`);
      const [reply] = await Promise.all([
        page.waitForResponse((r) => r.url().endsWith('/session')),
        page.getByRole('button', { name: 'Log in' }).click(),
      ]);
      await page
        .getByRole('alert')
        .getByText(reply.status() === 429 ? /locked for|open again/ : /password is wrong/)
        .waitFor();
    }
    await page.getByText(/locked for \d+ s more/).waitFor();
    assert.ok(await page.getByRole('button', { name: 'Log in' }).isDisabled());
    await done(page);
  });
}

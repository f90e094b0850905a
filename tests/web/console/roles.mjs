// Each role on each page: what it sees, what it can press, and what page and server refuse.
import assert from 'node:assert/strict';
import { done, settled, single, unfold } from './browser.mjs';
import { api } from './week.mjs';

const kRoles = { t: 'tina', i: 'ines', m: 'mara', a: 'ada', r: 'rhea' };
/**
 * By hand, not from the console's own table: [address, roles that see it, heading, what it asks of the server, {what
 * can be pressed: by whom}].
 * t trainee, i instructor, m manager, a administrator, r researcher.
 */
const kPages = [
  [
    '/',
    'timar',
    /^Welcome/,
    'session',
    { '0 struggling: the same requirement failed three times in a row': 'ima', 'Export a study': 'r' },
  ],
  ['/today/behind', 'ima', /^Behind$/, 'today?list=behind', { Home: 'ima' }],
  [
    '/account',
    'timar',
    /^My account$/,
    'session',
    { 'Set the password': 'timar', 'Give a code': 'timar', 'Download as JSON': 'tima' },
  ],
  ['/people', 'ima', /^People$/, 'people', { 'Add a person': 'ma', 'Import from CSV': 'ma' }],
  ['/people/import', 'ma', /^Import people$/, null, { Import: 'ma' }],
  [
    '/people/tina',
    'ima',
    /^tina$/,
    'people/ines',
    {
      Save: 'ma',
      'Disable …': 'ma',
      'Set the password': 'ma',
      'Give a code': 'ma',
      'Download as JSON': 'ma',
      'Find texts that name the person': 'a',
      'Erase all data …': 'a',
    },
  ],
  ['/groups', 'ima', /^Groups$/, 'groups', { 'Add a group': 'ma' }],
  ['/groups/both', 'ima', /^Both/, 'groups/both', { Save: 'ma', 'Remove the group …': 'ma' }],
  ['/profiles', 'ima', /^Patient profiles$/, null, { 'New profile': 'ma' }],
  ['/profiles-new', 'ma', /^New profile$/, null, { Save: 'ma' }],
  ['/profiles/knee-adult', 'ima', /^Knee, adult/, null, { Save: 'ma', Revisions: 'ima', 'Add a target': 'ma' }],
  ['/profiles/wrist-adult/revisions', 'ima', /^Revisions of/, null, { 'Save as the newest: revision 1': 'ma' }],
  ['/courses', 'ima', /^Courses$/, null, { 'New course': 'ma' }],
  ['/courses-new', 'ma', /^New course$/, null, { Save: 'ma' }],
  ['/courses/rheumatology-basics', 'ima', /^Phantoms/, null, { Save: 'ma', 'Add an exercise': 'ma' }],
  ['/courses/rheumatology-basics/revisions', 'ima', /^Revisions of/, null, {}],
  ['/assignments', 'ima', /^Assignments$/, 'people', { Assign: 'ima' }],
  ['/mine', 't', /^My results$/, null, { 'My progress': 't' }],
  [
    '/results?course=rheumatology-basics',
    'ima',
    /^Results$/,
    'groups',
    { 'Spreadsheet (CSV)': 'ima', 'Scores as CSV': 'ima' },
  ],
  ['/progress/tina', 'tima', /progress/i, 'people/tina/progress', {}],
  ['/live', 'ima', /^Live lab$/, 'stations', {}],
  ['/sessions', 'tima', /^Sessions$/, 'sessions', { Find: 'tima' }],
  [
    'SESSION',
    'tima',
    /^tina: Knee phantom: suprapatellar recess$/,
    'SESSION',
    {
      'Samples as CSV': 'tima',
      'Use as an expert reference': 'ima',
      'Excuse attempt 1 of tina': 'ima',
      'Add at 0:00.0': 'ia',
    },
  ],
  ['/unknown-trainees', 'ma', /^Unknown trainees$/, null, {}],
  [
    '/references/knee-recess',
    'ima',
    /^Experts of Knee phantom: suprapatellar recess$/,
    null,
    { 'Save the choice': 'ima' },
  ],
  ['/exports', 'imar', /^Exports$/, null, { 'Download scores as CSV': 'ima', 'Download the study': 'ar' }],
  ['/retention', 'ma', /^Retention$/, 'retention', { 'Save the policy': 'ma', 'Show what would happen': 'ma' }],
  ['/audit', 'a', /^Audit$/, 'audit', { Filter: 'a' }],
  ['/upkeep', 'a', /^Upkeep$/, 'audit', { 'Back up now': 'a', 'Check now': 'a', 'Score them again': 'a' }],
];

/** Pages of results and lessons: they show names, and no identifier of a measure or an exercise. */
const kOfNames = [
  '/assignments',
  '/mine',
  '/results?course=rheumatology-basics',
  '/progress/tina',
  '/live',
  '/sessions',
  'SESSION',
  '/references/knee-recess',
];
async function hasNoIdentifier(page, where) {
  const measures = (await api(page, 'measures')).items.map((m) => m.name.split('K')[0]).filter((n) => n.includes('_'));
  const identifiers = [...measures, 'knee-recess'];
  const shown = (names) => names.filter((name) => document.querySelector('main').innerText.includes(name));
  // names of exercises may come after the page
  for (let n = 0; n < 100 && (await page.evaluate(shown, identifiers)).length > 0; n++) await page.waitForTimeout(50);
  assert.deepEqual(await page.evaluate(shown, identifiers), [], where);
}

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function roles(t) {
  const it = single(t);
  for (const [letter, name] of Object.entries(kRoles)) {
    it(`${name}: ${kPages.filter(([, who]) => who.includes(letter)).length} pages of ${kPages.length}`, async () => {
      const page = await t.browser.as(name);
      for (const [path, who, title, asked, pressed] of kPages) {
        const address = path === 'SESSION' ? `/sessions/${t.session}` : path;
        const where = `${name} at ${address}`;
        await page.goto(`${t.lab.base}#${address}`);
        const heading = page.getByRole('heading', { level: 1 });
        if (!who.includes(letter)) {
          await page.getByRole('heading', { level: 1, name: '403: not for your role' }).waitFor();
          assert.equal(
            await page
              .getByRole('navigation')
              .getByRole('link')
              .evaluateAll((links, here) => links.filter((l) => l.getAttribute('href') === here).length, `#${address}`),
            0,
            `${where}: refused, but offered above`,
          );
          if (asked) {
            const at = asked === 'SESSION' ? `sessions/${t.session}` : asked;
            page.expected.add(403);
            const status = await page.evaluate(async (url) => (await fetch(url)).status, `/api/v1/${at}`);
            assert.equal(status, 403, `${where}: the server does not refuse GET ${at}`);
          }
          continue;
        }
        page.expected.delete(403);
        await heading.filter({ hasText: title }).waitFor();
        await settled(page);
        await unfold(page);
        assert.deepEqual(await page.locator('.problem').allInnerTexts(), [], where);
        if (kOfNames.includes(path)) await hasNoIdentifier(page, where);
        for (const [words, by] of Object.entries(pressed)) {
          const thing = page
            .locator('main')
            .getByRole('button', { name: words, exact: true })
            .or(page.locator('main').getByRole('link', { name: words, exact: true }));
          if (by.includes(letter)) await thing.first().waitFor();
          else assert.equal(await thing.count(), 0, `${where}: “${words}” is offered`);
        }
      }
      await done(page);
    });
  }

  it("a trainee sees nothing of another's", async () => {
    const page = await t.browser.as('tina');
    page.expected.add(403);
    const other = (await api(await t.browser.as('ada'), 'sessions')).items.find((s) => s.description.trainee !== 'tina')
      .description.session_id;
    await page.goto(`${t.lab.base}#/sessions/${other}`);
    await page.getByText('Not for your role').or(page.getByText('Not found')).first().waitFor();
    await page.goto(`${t.lab.base}#/progress/anna.bauer`);
    await page.getByRole('heading', { name: '403: not for your role' }).waitFor();
    await page.goto(`${t.lab.base}#/mine`);
    await page.getByRole('heading', { level: 1, name: 'My results' }).waitFor();
    await settled(page);
    assert.ok(!/Bauer|Osei/.test(await page.locator('body').innerText()));
    await done(page);
  });
}

// Accessibility: axe on every page at a tablet's width, and a whole task without a mouse.
import assert from 'node:assert/strict';
import { accessible, done, fitsWidth, kTablet, painted, single } from './browser.mjs';
import { kPassword } from './lab.mjs';
import { api } from './week.mjs';

const kPhoneWidths = [390, 320];
const kPages = [
  '/',
  '/today/behind',
  '/account',
  '/people',
  '/people/import',
  '/people/tina',
  '/groups',
  '/groups/both',
  '/profiles',
  '/profiles-new',
  '/profiles/knee-adult',
  '/profiles/wrist-adult/revisions',
  '/courses',
  '/courses-new',
  '/courses/rheumatology-basics',
  '/courses/rheumatology-basics/revisions',
  '/assignments',
  '/results?course=rheumatology-basics',
  '/progress/tina',
  '/live',
  '/sessions',
  'SESSION',
  '/unknown-trainees',
  '/references/knee-recess',
  '/exports',
  '/retention',
  '/audit',
  '/upkeep',
  '/nowhere',
];

/** Presses Tab until the element with this name has the focus; every element on the way must show its focus. */
async function tabTo(page, name, most = 120) {
  for (let n = 0; n < most; n++) {
    await page.keyboard.press('Tab');
    const here = await page.evaluate(() => {
      const e = document.activeElement,
        style = getComputedStyle(e);
      const label = e.getAttribute('aria-label') ?? [...(e.labels ?? [])].map((l) => l.textContent).join(' ') ?? '';
      return {
        name: (label || e.textContent || '').replace(/\s+/g, ' ').trim(),
        seen: style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 2,
        tag: e.tagName,
      };
    });
    if (here.tag === 'BODY') continue;
    assert.ok(here.seen, `the focus does not show on ${here.tag} “${here.name}”`);
    if (typeof name === 'string' ? here.name === name : name.test(here.name)) return;
  }
  throw new Error(`${most} times Tab, and no ${name}`);
}

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function access(t) {
  const it = single(t);
  it('axe finds nothing serious on any page, and every page fits a tablet and a phone', async () => {
    const page = await t.browser.window({ viewport: kTablet });
    await page.goto(t.lab.base);
    await page.getByRole('button', { name: 'Log in' }).waitFor();
    await accessible(page, 'the log-in');
    await done(page);
    for (const [name, pages] of [
      ['ada', kPages],
      ['tina', ['/', '/mine', '/progress/tina', 'SESSION']],
      ['rhea', ['/', '/exports', '/live']],
    ]) {
      const shown = await t.browser.as(name, { viewport: kTablet });
      for (const path of pages) {
        const address = path === 'SESSION' ? `/sessions/${t.session}` : path;
        await shown.goto(`${t.lab.base}#${address}`);
        await shown.getByRole('heading', { level: 1 }).waitFor();
        await accessible(shown, `${address} as ${name}`);
        await fitsWidth(shown, `${address} as ${name}`);
        for (const width of kPhoneWidths) {
          await shown.setViewportSize({ width, height: 800 });
          // plots follow in the next frames
          const fits = () => document.documentElement.scrollWidth <= window.innerWidth;
          await shown.waitForFunction(fits, null, { timeout: 5000 }).catch(() => {});
          await fitsWidth(shown, `${address} as ${name}, ${width} pixels wide`);
        }
        await shown.setViewportSize(kTablet);
      }
      await done(shown);
    }
  });

  it('by keyboard alone: log in, make a group, put somebody in, assign a course', async () => {
    const page = await t.browser.window();
    const { keyboard } = page;
    await page.goto(t.lab.base);
    await page.getByRole('button', { name: 'Log in' }).waitFor();
    // the first field gets the focus by itself
    await page.waitForFunction(() => document.activeElement?.matches('form.login input'));
    await keyboard.type('mara');
    await tabTo(page, 'Password');
    await keyboard.type(kPassword);
    await keyboard.press('Enter');
    await page.getByRole('heading', { level: 1, name: /^Welcome/ }).waitFor();
    await keyboard.press('g');
    await keyboard.press('g');
    await page.getByRole('heading', { level: 1, name: 'Groups' }).waitFor();
    await page.waitForFunction(() => document.activeElement?.id === 'page-title');
    await tabTo(page, 'Add a group');
    await keyboard.press('Enter');
    await painted(page.getByRole('dialog', { name: 'Add a group' }));
    await tabTo(page, 'Id');
    await keyboard.type('keys');
    await tabTo(page, 'Name');
    await keyboard.type('Keyboard');
    await keyboard.press('Enter');
    await page.getByRole('heading', { level: 1, name: 'Keyboard' }).waitFor();
    await tabTo(page, 'Find a trainee');
    await keyboard.type('tina');
    await page.getByText('1 trainee', { exact: true }).waitFor();
    await tabTo(page, /\(tina\)$/);
    await keyboard.press('Space');
    await tabTo(page, 'Save');
    await keyboard.press('Enter');
    await page.getByText(/Keyboard was saved: 1 members?/).waitFor();
    await keyboard.press('g');
    await keyboard.press('a');
    await page.getByRole('heading', { level: 1, name: 'Assignments' }).waitFor();
    await page.getByLabel('What').waitFor();
    await tabTo(page, /^What/);
    await keyboard.type('Course: Phantoms: lay');
    await tabTo(page, /^Assign to/);
    await keyboard.type('keyb');
    await page.getByRole('option', { name: 'Group: Keyboard (keys)' }).waitFor();
    await keyboard.press('Enter');
    await tabTo(page, 'Assign');
    await keyboard.press('Enter');
    await page.getByText('Phantoms: layered models was assigned to Keyboard (keys).').waitFor();
    assert.deepEqual(
      (await api(page, 'assignments?group=keys')).items.map((a) => [a.course_id, a.group_id]),
      [['rheumatology-basics', 'keys']],
    );
    await keyboard.press('?');
    await painted(page.getByRole('dialog', { name: 'Keyboard shortcuts' }));
    await keyboard.press('Escape');
    await page.getByRole('dialog').waitFor({ state: 'detached' });
    await done(page);
  });
}

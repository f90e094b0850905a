// Draws the pictures of this folder, 1280 × 720: pages of the console of a lab that deploy/demo --class has filled.
// usage: node tests/web/pictures/draw.mjs out/class/FOLDER     while deploy/demo --class runs
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { kChromium } from '../console/browser.mjs';

const here = fileURLToPath(new URL('.', import.meta.url));
const folder = process.argv[2];
if (!folder) throw new Error('usage: node tests/web/pictures/draw.mjs out/class/FOLDER');
const read = (name) => readFileSync(join(folder, name), 'utf8').trim();
const base = `https://127.0.0.1:${read('web-port')}/`;

const browser = await chromium.launch({
  executablePath: kChromium,
  args: ['--no-sandbox', '--disable-gpu'],
});
const page = await (
  await browser.newContext({ viewport: { width: 1280, height: 720 }, locale: 'en-GB', ignoreHTTPSErrors: true })
).newPage();
await page.goto(base);
await page.getByLabel('Name').fill('maria');
await page.getByLabel('Password').fill(read('maria.password'));
await page.getByRole('button', { name: 'Log in' }).click();
await page.getByRole('button', { name: 'Log out' }).waitFor();

/** @param {string} name of the file @param {string} hash of the page @param {import('playwright-core').Locator} shown when it is whole
 * @param {import('playwright-core').Locator} [pressed] before */
async function draw(name, hash, shown, pressed) {
  await page.goto(base + hash);
  await pressed?.click();
  await shown.first().waitFor();
  await page.waitForFunction(() => !document.querySelector('.loading'));
  await page.screenshot({ path: join(here, name) });
}
const of = (address) => page.evaluate(async (at) => (await fetch(`/api/v1/${at}`)).json(), address);
const { items } = await of('sessions?trainee=liam&exercise=lumbar-median&verdict=passed');
await draw(
  'profile.png',
  '#/profiles/lumbar-median',
  page.getByText(/^Force against the needle over/),
  page.getByRole('button', { name: 'Try it' }),
);
await draw(
  'session.png',
  `#/sessions/${items[0].description.session_id}`,
  page.getByRole('heading', { name: 'Plots' }),
);
await draw('results.png', '#/results?course=bodies', page.getByRole('region', { name: 'Results' }));
await browser.close();

// Chromium. Every page is watched for errors of scripts, breaches of the content policy and requests to other
// addresses.
import assert from 'node:assert/strict';
import { existsSync, readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { it } from 'node:test';
import { chromium } from 'playwright-core';
import { kLong_ms, kPassword } from './lab.mjs';

/** Without a window of its own (Debian's chromium-headless-shell) it takes 0.4 of the processor's time of the whole one. */
export const kChromium =
  process.env.NEEDLELAB_CHROMIUM ??
  ['/usr/bin/chromium-headless-shell', '/usr/bin/chromium'].find(existsSync) ??
  'chromium';
export const kDesk = { width: 1280, height: 900 };
export const kTablet = { width: 820, height: 1180 };
const kAxe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');
// Chromium logs these for every answer from 400 on, also for those that a page expects and shows
const kAnswered = /^Failed to load resource: the server responded with a status of (\d+)/;
const kNoLine = /^(Failed to load resource: net::ERR_|WebSocket connection to .* failed)/;

export class Browser {
  /** @param {import('./lab.mjs').Lab} lab */
  constructor(lab) {
    this.lab = lab;
    /** name → cookies of a log-in: each takes the server a quarter of a second on purpose */
    this.log_ins = new Map();
  }

  async begin() {
    this.chromium = await chromium.launch({
      // the first start of a machine reads the whole browser from its disk
      executablePath: kChromium,
      headless: true,
      timeout: 2 * kLong_ms,
      args: [
        '--no-sandbox',
        '--disable-gpu',
        '--disable-dev-shm-usage',
        '--disable-quic',
        '--disable-background-networking',
        '--disable-component-update',
        '--disable-sync',
        '--no-first-run',
      ],
    });
  }
  end() {
    return this.chromium?.close();
  }

  closeAll() {
    return Promise.all(this.chromium?.contexts().map((context) => context.close()) ?? []);
  }

  /** The text of the open pages, to explain why a test failed. */
  async testify(name) {
    const folder = process.env.NEEDLELAB_SHOTS;
    if (this.lab.server?.over)
      console.error(`--- the server ended with ${this.lab.server.code}:\n${this.lab.server.said.slice(-3000)}`);
    for (const page of this.chromium?.contexts().flatMap((context) => context.pages()) ?? []) {
      console.error(
        `--- ${page.url()}\n${page.faults?.join('\n') ?? ''}\n${(await page.locator('body').innerText({ timeout: 2000 }).catch(String)).slice(0, 3000)}`,
      );
      if (folder)
        await page
          .screenshot({
            path: `${folder}/${name.replace(/\W+/g, '-').slice(0, 60)}-${page.url().split('#')[1]?.replace(/\W+/g, '-') ?? ''}.png`,
            fullPage: true,
          })
          .catch(() => {});
    }
  }

  /**
   * A new window without a log-in. `page.faults` collects faults.
   * @param {{viewport?: {width: number, height: number}}} [options]
   */
  async window(options = {}) {
    // the certificate is the lab's own, and no browser knows its authority
    const context = await this.chromium.newContext({
      viewport: kDesk,
      locale: 'en-GB',
      ignoreHTTPSErrors: true,
      acceptDownloads: true,
      ...options,
    });
    context.setDefaultTimeout(kLong_ms);
    const page = await context.newPage();
    page.faults = [];
    /** statuses that the test expects, such as 409 */
    page.expected = new Set([401, 404]);
    page.line_may_break = false;
    page.on('pageerror', (error) => page.faults.push(`script: ${error.stack ?? error.message}`));
    page.on('console', (message) => {
      if (message.type() !== 'error' && !/Content Security Policy/.test(message.text())) return;
      const answered = kAnswered.exec(message.text());
      if (answered && page.expected.has(Number(answered[1]))) return;
      if (page.line_may_break && kNoLine.test(message.text())) return;
      page.faults.push(`console: ${message.text()} (${message.location().url})`);
    });
    context.on('request', (request) => {
      const url = request.url();
      if (
        !url.startsWith(this.lab.base) &&
        !url.startsWith(this.lab.base.replace('https', 'wss')) &&
        !/^(data|blob):/.test(url)
      )
        page.faults.push(`elsewhere: ${url}`);
    });
    return page;
  }

  /** A window in which `name` is logged in; reuses the log-in of an earlier window while that is valid. */
  async as(name, options) {
    const page = await this.window({
      storageState: { cookies: this.log_ins.get(name) ?? [], origins: [] },
      ...options,
    });
    await page.goto(this.lab.base);
    const inside = page.getByRole('button', { name: 'Log out' });
    await inside.or(page.getByRole('button', { name: 'Log in' })).waitFor();
    if (await inside.isVisible()) return page;
    await logIn(page, name);
    this.log_ins.set(name, (await page.context().storageState()).cookies);
    return page;
  }
}

export async function logIn(page, name, password = kPassword) {
  await page.getByLabel('Name').fill(name);
  await page.getByLabel('Password').fill(password);
  await page.getByRole('button', { name: 'Log in' }).click();
  await page.getByRole('button', { name: 'Log out' }).waitFor();
}

/** @param {string} hash '#/people' */
export async function open(page, lab, hash, title) {
  await page.goto(lab.base + hash);
  if (title) await page.getByRole('heading', { level: 1, name: title }).waitFor();
  await settled(page);
}

/** Opens everything that hides behind a title. */
export const unfold = (page) =>
  page.evaluate(() => document.querySelectorAll('form details').forEach((box) => box.setAttribute('open', '')));

/** Waits until nothing is being loaded. */
export async function settled(page) {
  await page.waitForFunction(() => !document.querySelector('.loading'));
}

/** Types into a field that searches, and chooses what is offered with that text. */
export async function chooseFrom(field, text, offered) {
  await field.fill(text);
  await field.page().getByRole('option', { name: offered, exact: true }).click();
}

/** Waits until a dialog takes keys: keys pressed before it is painted are not for it. */
export function painted(dialog) {
  return dialog.and(dialog.page().locator('[data-painted]')).waitFor();
}

/** Presses a button that asks first, and answers with the button of that name in its dialog. */
export async function confirmed(page, button, answer) {
  const dialog = page.getByRole('dialog');
  await button.click();
  await painted(dialog);
  await dialog.getByRole('button', { name: answer, exact: true }).click();
}

/** Presses keys while the page stands still: for half a second when `open` has opened a dialog, before it is painted. */
export async function pressedWhileItOpens(page, open, keys) {
  await page.evaluate(() => {
    const show = HTMLDialogElement.prototype.showModal;
    HTMLDialogElement.prototype.showModal = function () {
      HTMLDialogElement.prototype.showModal = show;
      show.call(this);
      console.debug('it stands still');
      const end_ms = performance.now() + 500;
      while (performance.now() < end_ms);
    };
  });
  const still = page.waitForEvent('console', (message) => message.text() === 'it stands still');
  const opened = open();
  await still;
  await Promise.all([opened, ...keys.map((key) => page.keyboard.press(key))]);
}

export async function done(page) {
  const { faults } = page;
  await page.context().close();
  assert.deepEqual(faults, [], 'the page was not clean');
}

/** All findings of axe that are serious or worse, and all elements wider than the window. */
export async function accessible(page, where) {
  await settled(page);
  // run by the debugger: the content policy forbids scripts that a page makes from text
  if (!(await page.evaluate(() => 'axe' in window))) await page.evaluate(kAxe);
  // a button on its way from one colour to another has neither's contrast
  await page.evaluate(() => {
    const changes = document.getAnimations().filter((one) => one instanceof CSSTransition);
    return Promise.allSettled(changes.map((one) => one.finished));
  });
  const found = await page.evaluate(async () => {
    const { violations } = await window.axe.run(document, { resultTypes: ['violations'] });
    return violations.map((v) => ({
      impact: v.impact,
      text: `${v.impact} ${v.id}: ${v.nodes
        .slice(0, 3)
        .map((n) => `${n.target.join(' ')} (${n.failureSummary?.split('\n')[1]?.trim() ?? ''})`)
        .join('; ')}`,
    }));
  });
  assert.deepEqual(
    found.filter((v) => ['serious', 'critical'].includes(v.impact)).map((v) => v.text),
    [],
    `axe on ${where}`,
  );
  return found;
}

export async function fitsWidth(page, where) {
  const over = await page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
  assert.ok(over <= 0, `${where} is ${over} px wider than the window`);
}

/** Number of pages of a printed page; of A4, if it says nothing else. @param {Browser} browser @param {string} html */
export async function printedPages(browser, html) {
  const page = await browser.window();
  await page.setContent(html);
  const pdf = (await page.pdf({ format: 'A4', preferCSSPageSize: true })).toString('latin1');
  await done(page);
  return pdf.match(/\/Type\s*\/Page\b/g).length;
}

/** The text of the file that a link or button downloads. */
export async function downloaded(page, press) {
  const [download] = await Promise.all([page.waitForEvent('download'), press()]);
  return { name: download.suggestedFilename(), text: readFileSync(await download.path(), 'utf8') };
}

/**
 * Independent tests. When one fails, the text of the pages is printed, and pictures go into the folder NEEDLELAB_SHOTS
 * if that is set.
 * @param {{browser: Browser}} t
 */
export const single = (t) => (name, work) =>
  it(name, async () => {
    try {
      await work();
    } catch (error) {
      await t.browser?.testify(name);
      await t.browser?.closeAll();
      throw error;
    }
  });

/**
 * Tests that each continue where the previous one ended: after a failure the rest is skipped.
 * @param {{browser: Browser}} t
 */
export function story(t) {
  let broken = '';
  return (name, work) =>
    it(name, async (test) => {
      if (broken) return test.skip(`after “${broken}” failed`);
      try {
        await work();
      } catch (error) {
        broken = name;
        await t.browser?.testify(name);
        await t.browser?.closeAll();
        throw error;
      }
      return undefined;
    });
}

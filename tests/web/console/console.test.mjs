// The web console in a browser, against the real server and real stations with simulated devices.
import assert from 'node:assert/strict';
import { after, before, describe, it } from 'node:test';
import { access } from './access.mjs';
import { bodies } from './bodies.mjs';
import { Browser } from './browser.mjs';
import { drafts } from './drafts.mjs';
import { home } from './home.mjs';
import { Lab } from './lab.mjs';
import { longLists } from './lists.mjs';
import { malformed } from './malformed.mjs';
import { roles } from './roles.mjs';
import { shaping } from './shaping.mjs';
import { trouble } from './trouble.mjs';
import { upkeep } from './upkeep.mjs';
import { api, week } from './week.mjs';

const t = {};

describe('the web console', { concurrency: false }, () => {
  before(async () => {
    t.lab = new Lab();
    t.browser = new Browser(t.lab);
    await Promise.all([t.lab.begin(), t.browser.begin()]);
    // somebody practises meanwhile: this session exists whether or not the tests of the week pass
    t.first_lesson = t.lab.practise('station-2', 'tina', 'knee-recess', ['--seconds', '6', '--hand-speed-m-s', '0.03']);
  });
  after(async () => {
    await t.browser?.end();
    await t.lab?.end(!!process.env.NEEDLELAB_KEEP);
  });
  describe("a manager's week", () => week(t));
  describe('trouble', () => {
    it('a lesson was stored meanwhile', async () => {
      assert.equal(await t.first_lesson.ended, 0, t.first_lesson.said);
      const page = await t.browser.as('ada');
      t.session = (await api(page, 'sessions?trainee=tina')).items.at(-1).description.session_id;
      await page.context().close();
    });
    trouble(t);
  });
  describe('bodies', () => bodies(t));
  describe('shaping bodies', () => shaping(t));
  describe('malformed documents', () => malformed(t));
  describe('upkeep', () => upkeep(t));
  describe('home', () => home(t));
  describe('roles', () => roles(t));
  describe('access', () => access(t));
  describe('drafts', () => drafts(t));
  describe('long lists', () => longLists(t));
  it('the server stops in order', async () => assert.equal(await t.lab.stopServer(), 0, t.lab.server.said));
});

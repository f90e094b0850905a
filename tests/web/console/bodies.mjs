// A lesson at a body: on the live page while it runs, then its session with the needle in a cut through the body.
import assert from 'node:assert/strict';
import { accessible, done, open, printedPages, single } from './browser.mjs';
import { until } from './lab.mjs';
import { api } from './week.mjs';

/** @param {{lab: import('./lab.mjs').Lab, browser: import('./browser.mjs').Browser}} t */
export function bodies(t) {
  const it = single(t);
  it('a lesson at a body: live, then the needle in its cut', async () => {
    const page = await t.browser.as('ines');
    const hand = ['--hand-plan', 'depth:0.02', '--hand-speed-m-s', '0.05', '--hand-hold-s', '1', '--seconds', '3'];
    const lesson = t.lab.practise('station-1', 'guest', 'lumbar-median', hand);
    await open(page, t.lab, '#/live', 'Live lab');
    const tile = page.getByRole('listitem', { name: 'Station station-1' });
    const { json } = await api(page, 'profiles/lumbar-median');
    const under_skin = json.volume.structures.slice(1).map(({ id, layer }) => layer.name ?? id);
    await until('a structure under the skin at the tip', async () => {
      if (lesson.over) throw new Error(`exit ${lesson.code}: ${lesson.said}`);
      const words = await tile.innerText();
      return under_skin.some((name) => words.includes(`, tip in ${name}\n`));
    });
    assert.equal(await lesson.ended, 0, lesson.said);

    const [{ description }] = (await api(page, 'sessions?trainee=guest')).items;
    const at = `sessions/${description.session_id}`;
    const { columns } = await api(page, `${at}/samples?points=2000`);
    await open(page, t.lab, `#/${at}`, 'guest: Lumbar: epidural space');
    const drawing = page.getByRole('img', { name: /^Cut through the body where the needle first came in/ });
    await drawing.getByText('Subcutaneous fat', { exact: true }).waitFor();
    const play = page.getByRole('button', { name: 'Play' });
    const seenIn = async (width, height, places) => {
      await page.setViewportSize({ width, height });
      await until(
        `the page at ${width}`,
        async () => (await page.evaluate(() => document.documentElement.scrollWidth)) <= width,
      );
      for (const place of places) {
        const box = await place.boundingBox();
        assert.ok(
          box.y >= 0 && box.y + box.height <= height,
          `${place} at ${width} × ${height}: ${JSON.stringify(box)}`,
        );
      }
    };
    const size = page.viewportSize();
    await seenIn(390, 844, [page.locator('.judgement'), play]);
    await page.getByRole('listitem').getByText('Subcutaneous fat', { exact: true }).waitFor(); // below the drawing
    await seenIn(1280, 720, [page.locator('.judgement'), play, drawing]);
    await page.setViewportSize(size);
    const moment = page.getByRole('slider', { name: 'Moment' });
    // a straight way: the tip is as far from the place of insertion as it is deep
    const deepest = columns.insertion_m.indexOf(Math.max(...columns.insertion_m));
    await moment.fill(columns.t_s[deepest].toFixed(2));
    await page.getByText(/^Tip in the cut/).waitFor();
    const number = async (selector, name) => Number(await drawing.locator(selector).getAttribute(name));
    const [, x, y] = /^M([\d.]+) ([\d.]+)l/.exec(await drawing.locator('.entry').getAttribute('d'));
    const centimetre = (await number('.ruler line', 'x2')) - (await number('.ruler line', 'x1'));
    const from_entry = Math.hypot((await number('.tip-now', 'cx')) - x, (await number('.tip-now', 'cy')) - y);
    const drawn_m = (0.01 * from_entry) / centimetre;
    assert.ok(Math.abs(drawn_m - columns.insertion_m[deepest]) < 0.0015, `${drawn_m} ${columns.insertion_m[deepest]}`);
    await accessible(page, 'a session at a body');
    assert.ok((await printedPages(t.browser, await t.lab.report(description.session_id))) <= 2, 'the report is short');
    await done(page);
  });
}

// Walks the console's main pages with a faculty's database (tests/bench/lists_bench.cpp): their contents are compared with
// the database, and each page's time to content is printed.
// usage: node tests/web/console/large.mjs FOLDER   FOLDER/lists: a data folder of lists_bench --folder FOLDER, of either engine;
// walk_large makes one of each. What each page may ask of the server has bounds: no page loads everybody.
// environment: as run.mjs
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { existsSync, readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { Browser, chooseFrom, done, open } from './browser.mjs';
import { Lab } from './lab.mjs';

// a page of 100 trainees' results has 500 kB, one of 200 scores 700 kB; all people would be 900 kB in seven replies
const kMostReplies = 6,
  kMostBytes = 1 << 20;
const kGroup = 'class-07';

/** The first column of what the database itself answers, without needlelab's programs; no server runs yet. */
function asked(data, sql) {
  const store = join(data, 'store');
  const url = existsSync(store) && /^url = (.*)$/m.exec(readFileSync(store, 'utf8'))?.[1];
  const [program, args] = url
    ? ['psql', [url, '-X', '-A', '-t', '-v', 'ON_ERROR_STOP=1', '-c', `SET search_path = needlelab; ${sql}`]]
    : [
        'python3',
        [
          '-c',
          'import sqlite3, sys\nfor row in sqlite3.connect("file:" + sys.argv[1] + "?mode=ro", uri=True).execute(sys.argv[2]): print(row[0])',
          join(data, 'needlelab.db'),
          sql,
        ],
      ];
  const { status, stdout, stderr } = spawnSync(program, args, { encoding: 'utf8' });
  assert.equal(status, 0, stderr);
  return stdout.split('\n').filter((line) => line && line !== 'SET');
}

const lab = new Lab(join(resolve(process.argv[2] ?? '.'), 'lists'));
const browser = new Browser(lab);
try {
  assert.ok(existsSync(lab.data), `${lab.data} is not there: lists_bench --folder makes it`);
  const count = (sql) => Number(asked(lab.data, sql)[0]);
  // a person with a password of this test
  if (count("SELECT count(*) FROM accounts WHERE name = 'mara'") === 0)
    await lab.admin('user', 'add', 'mara', '--role', 'curriculum-manager', '--password-file', lab.password_file);
  // the trainee who practised first; all are called as lists_bench does
  const [ref] = asked(
    lab.data,
    "SELECT trainee FROM sessions WHERE trainee LIKE '@%' ORDER BY started_unix_ns LIMIT 1",
  );
  const [trainee] = asked(lab.data, `SELECT name FROM accounts WHERE ref = '${ref}'`);
  const full_name = `Person Number ${Number(trainee.replace(/\D+/, ''))}`;
  const said = {
    people: count('SELECT count(*) FROM accounts'),
    trainees: count('SELECT count(*) FROM accounts WHERE role = 1'),
    found: count(
      "SELECT count(*) FROM accounts WHERE lower(full_name) LIKE '%number 17%' OR lower(name) LIKE '%number 17%'",
    ),
    sessions: count('SELECT count(*) FROM sessions'),
    groups: count('SELECT count(*) FROM groups WHERE removed = 0'),
    members: count(`SELECT count(*) FROM group_members WHERE group_id = '${kGroup}'`),
    takers: count(
      "SELECT count(*) FROM (SELECT trainee FROM sessions WHERE exercise_id LIKE 'exercise-%' UNION SELECT person FROM group_members) t",
    ),
    passed: count(
      "SELECT count(DISTINCT trainee) FROM sessions WHERE exercise_id = 'exercise-0' AND passed = 1 AND excused = 0",
    ),
    own: count(`SELECT count(*) FROM sessions WHERE trainee = '${ref}'`),
    own_at: asked(
      lab.data,
      `SELECT count(*) FROM sessions WHERE trainee = '${ref}' GROUP BY exercise_id ORDER BY max(started_unix_ns) DESC`,
    ).map(Number),
    guest: count("SELECT count(*) FROM sessions WHERE trainee = 'guest' AND exercise_id = 'exercise-3'"),
    behind: count(
      "SELECT count(*) FROM accounts c WHERE c.role = 1 AND EXISTS (SELECT 1 FROM exercises e WHERE e.curriculum_id = 'everybody' AND NOT EXISTS (SELECT 1 FROM sessions s WHERE s.trainee = c.ref AND s.exercise_id = e.id AND s.passed = 1 AND s.excused = 0))",
    ),
    assigned: count('SELECT count(*) FROM assignments'),
    scores: count(
      `SELECT count(*) FROM scores c JOIN sessions s ON s.number = c.session JOIN group_members m ON m.person = s.trainee AND m.group_id = '${kGroup}'`,
    ),
  };
  console.log(JSON.stringify(said));
  await lab.startServer();
  await browser.begin();
  const page = await browser.as('mara');
  const walked = [],
    asked_of = [];
  page.on('response', (r) => r.url().includes('/api/v1/') && asked_of.push(r));
  /** @param {() => Promise<void>} content resolves when the page shows what the database says */
  const walk = async (name, hash, title, content) => {
    await open(page, lab, '#/account');
    asked_of.length = 0;
    const from = performance.now();
    await page.goto(lab.base + hash);
    await page.getByRole('heading', { level: 1, name: title }).waitFor();
    await content();
    const ms = performance.now() - from;
    walked.push(name);
    const sizes = await Promise.all(asked_of.map(async (r) => (await r.body()).length));
    const bytes = sizes.reduce((sum, one) => sum + one, 0);
    console.log(`${name}: content after ${ms.toFixed(0)} ms, of ${sizes.length} replies with ${bytes} bytes`);
    assert.ok(sizes.length <= kMostReplies, `${name} asked ${sizes.length} times: ${asked_of.map((r) => r.url())}`);
    assert.ok(bytes <= kMostBytes, `${name} loaded ${bytes} bytes`);
    if (process.env.NEEDLELAB_SHOTS)
      await page.screenshot({ path: `${process.env.NEEDLELAB_SHOTS}/large-${name}.png` });
  };
  const caption = (text) => page.locator('caption').getByText(text).first().waitFor();

  await walk('home', '#/', /^Welcome/, () =>
    page.getByRole('link', { name: `${said.behind} trainees are behind` }).waitFor(),
  );
  await walk('people', '#/people', 'People', () => caption(`100 of ${said.people} people`));
  await walk('people-found', '#/people?find=number+17', 'People', () =>
    caption(said.found > 100 ? `100 of ${said.found} people` : `${said.found} people`),
  );
  await walk('groups', '#/groups', 'Groups', async () => {
    await caption('Groups');
    await page
      .locator('tbody tr')
      .nth(said.groups - 1)
      .waitFor();
    assert.equal(await page.locator('tbody tr').count(), said.groups);
  });
  await walk('group', `#/groups/${kGroup}`, 'A class', async () => {
    await page.getByText(`Members: ${said.members}`).waitFor();
    const shown = Math.min(said.members, 100);
    assert.equal(await page.getByRole('group', { name: 'Present members' }).getByRole('checkbox').count(), shown);
    await page.getByText(`50 of ${said.trainees} trainees`).waitFor();
  });
  await walk('results', '#/results?course=everybody', 'Results', async () => {
    await caption(`100 of ${said.takers} trainees, 8 exercises`);
    await page.getByText(`${said.passed} of ${said.takers} passed`).first().waitFor();
  });
  await walk('results-of-group', `#/results?course=everybody&group=${kGroup}`, 'Results', () =>
    caption(`${said.members} trainees, 8 exercises`),
  );
  await walk('sessions', '#/sessions', 'Sessions', () => caption(/^The newest 100 sessions|100/));
  await walk('progress', `#/progress/${trainee}`, /./, () => caption(`${said.own_at[0]} attempt`));
  await walk('progress-of-guest', '#/progress/guest?exercise=exercise-3', /./, async () => {
    const shown = Math.min(said.guest, 200);
    await caption(`${shown < said.guest ? '200 of ' : ''}${said.guest} attempts, newest first`);
    await page.getByRole('link', { name: `Attempt ${said.guest}`, exact: true }).waitFor();
    assert.equal(await page.locator('.table-frame tbody tr').count(), shown);
  });
  await walk('assignments', '#/assignments', 'Assignments', async () => {
    await caption(`${said.assigned} assignments`);
    assert.equal(await page.locator('tbody tr').count(), said.assigned);
  });
  // somebody of 3,000, to whom nothing is assigned yet
  await chooseFrom(page.getByLabel('Assign to'), full_name, `${full_name} (${trainee})`);
  await page.getByLabel('What').selectOption('exercise:exercise-3');
  await page.getByRole('button', { name: 'Assign', exact: true }).click();
  await page.getByText(`was assigned to ${full_name} (${trainee}).`).waitFor();
  await page.getByRole('button', { name: new RegExp(`^Withdraw .* from ${trainee}$`) }).click();
  await page.getByRole('dialog').getByRole('button', { name: 'Withdraw' }).click();
  await page.getByText('The assignment was withdrawn.').waitFor();

  const csv = await page.evaluate(async (address) => {
    const from = performance.now();
    const reply = await fetch(address);
    const text = await reply.text();
    if (!reply.ok) throw new Error(`${reply.status} ${text}`);
    return {
      ms: performance.now() - from,
      rows: new Set(
        text
          .trim()
          .split('\r\n')
          .slice(1)
          .map((l) => l.split(',')[3]),
      ).size,
    };
  }, `/api/v1/scores.csv?course=everybody&group=${kGroup}`);
  assert.equal(csv.rows, said.scores, 'scores of the group');
  console.log(`scores of a group as CSV: ${csv.rows} sessions in ${csv.ms.toFixed(0)} ms`);
  await done(page);
  const status = readFileSync(`/proc/${lab.server.child.pid}/status`, 'utf8');
  console.log(`pages walked: ${walked.length}, sessions in the database: ${said.sessions}`);
  console.log(`resident memory of the server: ${Math.round(Number(/VmRSS:\s+(\d+)/.exec(status)[1]) / 1024)} MiB`);
  assert.equal(await lab.stopServer(), 0);
} catch (error) {
  await browser.testify('large').catch(() => {});
  throw error;
} finally {
  await browser.end();
  await lab.end();
}

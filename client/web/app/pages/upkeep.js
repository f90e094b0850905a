// Free space on the disk, what recordings survive, a backup now, a check that everything can be read, scores computed
// again, and settings of the whole lab.
import { durability, missing, roomLevel, storingTrouble } from '../lib/database.js';
import { moment } from '../lib/time.js';
import { bytes, counted } from '../lib/units.js';
import { exercises, upkeep } from '../net/requests.js';
import { CheckField, SelectField, TextField } from '../ui/fields.js';
import { DraftBack, useDraft } from '../ui/draft.js';
import { useAction, useEvery, useLoad } from '../ui/hooks.js';
import { html, useEffect, useState } from '../ui/html.js';
import { Heading, Loaded, Mark, Problem } from '../ui/widgets.js';
import { CodesRequired } from './people/codes.js';

/** Shows that a long task is running: a moving bar and the time taken so far. */
function Working({ busy, children }) {
  const [since_ms, setSince] = useState(0);
  const [now_ms, setNow] = useState(0);
  useEffect(() => {
    setSince(Date.now());
    setNow(Date.now());
  }, [busy]);
  useEvery(500, () => busy && setNow(Date.now()));
  return (
    busy &&
    html`<p class="working">
      <progress aria-label=${children}></progress> <span aria-hidden="true">
        ${children} … ${Math.round((now_ms - since_ms) / 1000)} s
      </span>
    </p>`
  );
}

const kRoomAgain_ms = 15_000;

/** The free space on the database's disk, what the server refuses, and what to do. */
export function RoomText({ room }) {
  const { kind, name, means, next } = roomLevel(room.level);
  const left = room.left_bytes === undefined ? 'not known yet' : bytes(room.left_bytes);
  return html`<p><${Mark} kind=${kind}>${name}<//> ${`Room left on the disk of the database: ${left}. ${means}`}</p>
    <p>${next}</p>`;
}

function Room() {
  const room = useLoad((signal) => upkeep.room(signal), []);
  useEvery(kRoomAgain_ms, room.reload);
  return html`<fieldset>
    <legend>Room on the disk</legend>
    <${Loaded} load=${room}>${(data) => html`<div role="status"><${RoomText} room=${data} /></div>`}<//>
  </fieldset>`;
}

/** What an acknowledgement survives, whether changes are stored now, and what to do. */
export function StoreText({ store }) {
  const { kind, means, next } = durability(store.ack_survives);
  const troubles = [storingTrouble(store), missing(store)].filter((trouble) => trouble !== undefined);
  return html`${troubles.map(
    (trouble) => html`<p><${Mark} kind=${trouble.kind}>${trouble.name}<//> ${trouble.means}</p><p>${trouble.next}</p>`,
  )}
    <p><${Mark} kind=${kind}>${store.ack_survives}<//> ${`A recording that the server has confirmed survives ${store.ack_survives}. ${means}`}</p>
    <p>${next}</p>`;
}

function Storing() {
  const store = useLoad((signal) => upkeep.store(signal), []);
  useEvery(kRoomAgain_ms, store.reload);
  return html`<fieldset>
    <legend>What a recording survives</legend>
    <${Loaded} load=${store}>${(data) => html`<div role="status"><${StoreText} store=${data} /></div>`}<//>
  </fieldset>`;
}

const kDisks = {
  ANOTHER_DISK: "on another disk than the server's database",
  SAME_DISK: "on the same disk as the server's database",
  DISK_UNKNOWN: 'on a disk that the server does not know',
};

/** What a backup's place means for the stations. */
function Place({ done }) {
  return html`<p>
    <${Mark} kind=${done.safe ? 'good' : 'warn'}>${done.safe ? 'Safe' : 'not Safe'}<//> It is
    ${` ${kDisks[done.disk] ?? kDisks.DISK_UNKNOWN}: ${
      done.safe ? 'stations delete the recordings in it.' : 'stations keep the recordings in it.'
    }`}
  </p>`;
}

function Backup() {
  const [entry, setEntry, draft] = useDraft('backup', { path: '', counts_as_safe: false });
  const { path, counts_as_safe } = entry;
  const [done, setDone] = useState(null);
  const action = useAction();
  const start = async (event) => {
    event.preventDefault();
    setDone(null);
    const result = await action.run(() => upkeep.backup(path.trim(), counts_as_safe));
    if (!result) return;
    draft.drop();
    setDone({ ...result, at: Date.now() });
  };
  return html`<form onSubmit=${start}>
    <fieldset>
      <legend>Backup</legend>
      <${DraftBack} draft=${draft} />
      <p>A copy of the whole database, made while the lab keeps running, then read back and verified.</p>
      <${TextField}
        label="File on the server's machine"
        value=${path}
        onValue=${(text) => setEntry({ ...entry, path: text })}
        help="empty: where the server puts its backups"
        autocomplete="off"
        spellcheck="false"
      />
      <${CheckField}
        label="Counts as Safe on any disk"
        checked=${counts_as_safe}
        onValue=${(on) => setEntry({ ...entry, counts_as_safe: on })}
        help="Stations delete what is Safe. A backup normally makes recordings Safe only on a different disk from the database: on the same one, a fault takes both."
      />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy}>${
          action.busy ? 'Backing up …' : 'Back up now'
        }</button>
      </div>
      <${Working} busy=${action.busy}>Copying and reading back<//>
      <div role="status">${
        done &&
        html`<p>
             <${Mark} kind="good">verified<//> ${done.encrypted && html`<${Mark} kind="good">encrypted<//> `}${done.path}: ${bytes(done.bytes)}, ${counted(done.chunks_verified, 'piece')} of recordings read back, ${moment(done.at)}.
             ${done.undecodable_chunks > 0 && html`${counted(done.undecodable_chunks, 'piece')} cannot be decoded and ${done.undecodable_chunks === 1 ? 'is' : 'are'} not safe.`}
           </p>
           <${Place} done=${done} />`
      }</div>
      <${Problem} error=${action.error} title="No backup was made" />
    </fieldset>
  </form>`;
}

function Check() {
  const [report, setReport] = useState(null);
  const action = useAction();
  const start = async () => {
    setReport(null);
    setReport((await action.run(() => upkeep.check())) ?? null);
  };
  return html`<fieldset>
    <legend>Check</legend>
    <p>
      Reads every recording and compares its checksums. It takes a while with many sessions; the lab keeps running.
    </p>
    <div class="actions">
      <button type="button" class="main" disabled=${action.busy} onClick=${start}>${
        action.busy ? 'Checking …' : 'Check now'
      }</button>
    </div>
    <${Working} busy=${action.busy}>Reading everything<//>
    <div role="status">${
      report &&
      html`
        <p>
          <${Mark} kind=${report.ok ? 'good' : 'bad'}>${report.ok ? 'all is well' : 'faults'}<//>
          ${` ${counted(report.sessions, 'session')}, ${counted(report.chunks, 'piece')} of recordings.`}
        </p>
        ${report.faults?.length > 0 && html`<ul>${report.faults.map((fault) => html`<li>${fault}</li>`)}</ul>`}
      `
    }</div>
    <${Problem} error=${action.error} title="The check could not be run" />
  </fieldset>`;
}

/**
 * Definitions of measures change with the program's version: sessions scored by older versions can also be scored by
 * today's.
 */
function Rescore() {
  const known = useLoad((signal) => exercises(signal), []);
  const [exercise_id, choose] = useState('');
  const [report, setReport] = useState(null);
  const action = useAction();
  const run = async (dry_run) => {
    setReport(null);
    setReport((await action.run(() => upkeep.rescore(exercise_id, dry_run))) ?? null);
  };
  return html`<fieldset>
    <legend>Scores</legend>
    <p>
      Sessions that were scored by older definitions get a score by today's as well. The first score, which the trainee
      was given, stays.
    </p>
    <${SelectField}
      label="Exercise"
      value=${exercise_id}
      onValue=${choose}
      options=${[['', 'All exercises'], ...(known.data ?? []).map((e) => [e.id, e.name])]}
    />
    <div class="actions">
      <button type="button" disabled=${action.busy} onClick=${() => run(true)}>How many are there?</button>
      <button type="button" class="main" disabled=${action.busy} onClick=${() => run(false)}>Score them again</button>
    </div>
    <${Working} busy=${action.busy}>Scoring<//>
    <div role="status">${
      report &&
      html`
        <p>
          ${
            report.dry_run
              ? html`<${Mark} kind="info">would be<//>`
              : html`<${Mark} kind=${report.left_alone ? 'warn' : 'good'}>done<//>`
          }
          ${` ${report.rescored} scored by definitions ${report.definition_version}`}
          ${report.left_alone ? `, ${report.left_alone} could not be` : ''}.
        </p>
        ${
          report.faults?.length > 0 &&
          html`<ul>${report.faults.map(
            (f, i) => html`<li><a href=${`#/sessions/${f.session_id}`}>Session ${i + 1}</a>: ${f.text}</li>`,
          )}</ul>`
        }
      `
    }</div>
    <${Problem} error=${known.error ?? action.error} title="Could not be scored" />
  </fieldset>`;
}

export function UpkeepPage() {
  return html`<${Heading} title="Upkeep" /><${Room} /><${Storing} /><${Backup} /><${Check} /><${Rescore} /><${CodesRequired} />`;
}

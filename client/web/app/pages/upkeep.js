// A backup now, and whether everything can be read.
import { moment } from '../lib/time.js';
import { bytes } from '../lib/units.js';
import { upkeep } from '../net/lab.js';
import { TextField } from '../ui/fields.js';
import { useAction } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';
import { Heading, Mark, Problem } from '../ui/parts.js';

function Backup() {
  const [path, setPath] = useState('');
  const [done, setDone] = useState(null);
  const action = useAction();
  const start = async (event) => {
    event.preventDefault();
    setDone(null);
    const result = await action.run(() => upkeep.backup(path.trim()));
    if (result) setDone({ ...result, at: Date.now() });
  };
  return html`<form onSubmit=${start}><fieldset><legend>Backup</legend>
    <p>A copy of the whole database, made while the lab goes on, then read back and verified.</p>
    <${TextField} label="File on the server's machine" value=${path} onValue=${setPath} help="empty: where the server puts its backups" autocomplete="off" spellcheck="false" />
    <div class="actions"><button type="submit" class="main" disabled=${action.busy}>${action.busy ? 'Backing up …' : 'Back up now'}</button></div>
    <div role="status">${done && html`<p><${Mark} kind="good">verified<//> ${done.path}: ${bytes(done.bytes)}, ${done.chunks_verified} pieces of recordings read back, ${moment(done.at)}.</p>`}</div>
    <${Problem} error=${action.error} title="There is no new backup" /></fieldset></form>`;
}

function Check() {
  const [report, setReport] = useState(null);
  const action = useAction();
  const start = async () => {
    setReport(null);
    setReport((await action.run(() => upkeep.check())) ?? null);
  };
  return html`<fieldset><legend>Check</legend>
    <p>Reads every recording and compares its checksums. It takes a while with many sessions; the lab goes on meanwhile.</p>
    <div class="actions"><button type="button" class="main" disabled=${action.busy} onClick=${start}>${action.busy ? 'Checking …' : 'Check now'}</button></div>
    <div role="status">${report && html`<p>${report.ok ? html`<${Mark} kind="good">all is well<//>` : html`<${Mark} kind="bad">faults<//>`} ${report.sessions} sessions, ${report.chunks} pieces of recordings.</p>
      ${report.faults?.length > 0 && html`<ul>${report.faults.map((fault) => html`<li>${fault}</li>`)}</ul>`}`}</div>
    <${Problem} error=${action.error} title="The check could not be made" /></fieldset>`;
}

export function UpkeepPage() {
  return html`<${Heading} title="Upkeep" /><${Backup} /><${Check} />`;
}

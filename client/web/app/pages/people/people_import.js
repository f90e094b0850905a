// Imports a class from a CSV file; shows what will happen first.
import {
  columnsOf,
  headerOf,
  kChoices,
  kParts,
  remember,
  remembered,
  renamesOf,
  takenOf,
  withColumns,
} from '../../lib/class_columns.js';
import { people } from '../../net/requests.js';
import { announce, Heading, Mark, Problem, Table } from '../../ui/widgets.js';
import { NumberField, SelectField, TextField } from '../../ui/fields.js';
import { DraftBack, useDraft } from '../../ui/draft.js';
import { useAction } from '../../ui/hooks.js';
import { html, useId, useState } from '../../ui/html.js';

const kColumns = ['name', 'full_name', 'role', 'group', 'password', 'code'];
const kWhat = {
  ADD: ['good', 'new'],
  CHANGE: ['warn', 'changes'],
  NOTHING: ['open', 'stays'],
  FAULT: ['bad', 'wrong'],
};
const kSample = 'name,full_name,role,group\nanna.bauer,Anna Bauer,trainee,autumn-a\n';
const kMost_bytes = 1 << 20;
const kMost_lines = 1000;

/**
 * The text of a file. A spreadsheet's "CSV" is often Windows-1252.
 * @param {ArrayBuffer} bytes
 * @param {string} [encoding] what a person has chosen
 * @returns {string | null} null: the text is in another encoding
 */
export function textOf(bytes, encoding) {
  const [a, b] = new Uint8Array(bytes);
  const mark = a === 0xff && b === 0xfe ? 'utf-16le' : a === 0xfe && b === 0xff ? 'utf-16be' : 'utf-8';
  try {
    return new TextDecoder(encoding ?? mark, { fatal: true }).decode(bytes);
  } catch {
    return null;
  }
}

/** Asks which column is what. @param {{columns: import('../../lib/class_columns.js').Column[], choose: (renames: any) => void, busy: boolean}} props */
function Columns({ columns, choose, busy }) {
  const [chosen, setChosen] = useState(takenOf(columns));
  const parts = ['given_name', 'family_name'].flatMap((name) =>
    columns.filter((c) => c.taken_as === name).map((c) => c.cell),
  );
  const cells = columns.map(({ cell }) => [cell, cell]);
  const together = parts.length > 0 ? [[kParts, parts.join(' and ')]] : [];
  const send = (event) => {
    event.preventDefault();
    choose(renamesOf(columns, chosen));
  };
  return html`<form class="hint" aria-label="Columns of the list" onSubmit=${send}>
    <p><strong>Which column is what?</strong> It is asked once: this browser remembers it for lists with this header.</p>
    <div class="fields">${kChoices.map(
      ([name, label]) => html`<${SelectField}
        label=${label}
        value=${chosen[name]}
        required=${name === 'name'}
        options=${[['', name === 'name' ? 'Choose …' : 'none'], ...(name === 'full_name' ? together : []), ...cells]}
        onValue=${(cell) => setChosen({ ...chosen, [name]: cell })}
      />`,
    )}</div>
    <div class="actions">
      <button type="submit" disabled=${busy || !chosen.name}>Use these columns</button>
    </div>
  </form>`;
}

/** The columns that were chosen for this header. @param {{renames: Record<string, string>, again: () => void, busy: boolean}} props */
function ChosenColumns({ renames, again, busy }) {
  const said = kChoices.flatMap(([, label, word]) =>
    Object.keys(renames)
      .filter((cell) => renames[cell] === word)
      .map((cell) => `“${cell}” is the ${label.toLowerCase()}`),
  );
  return html`<p>
    Columns as chosen in this browser: ${said.join(', ') || 'by their words'}. <button
      type="button"
      class="small"
      disabled=${busy}
      onClick=${again}
    >Choose again</button>
  </p>`;
}

function Report({ report }) {
  const ignored = columnsOf(report).filter((c) => !c.taken_as);
  const rows = (report.rows ?? []).filter((row) => row.what in kWhat);
  const counts = `${report.added} new, ${report.changed} changed, ${report.unchanged} unchanged, ${report.faults} wrong`;
  return html`
    <h2>${report.done ? 'What happened' : 'What will happen'}</h2>
    ${
      report.done
        ? html`<div class="hint" role="status">
            <p><strong>✓ Imported:</strong> ${counts}. <a href="#/people">Show the people</a></p>
          </div>`
        : report.faults
          ? html`<div class="problem" role="alert">
              <p>
                <strong>
                  ✗ ${report.faults === 1 ? 'One row is' : report.faults + ' rows are'} wrong: nothing is imported until
                  all are right.
                </strong>
              </p>
              <p>Correct them in the list above, then check again.</p>
            </div>`
          : html`<p role="status">${counts}. Nothing has been changed yet.</p>`
    }
    ${ignored.length > 0 && html`<p>Ignored: ${ignored.map((c) => c.cell).join(', ')}.</p>`}
    ${
      !report.faults &&
      report.rights_given > 0 &&
      html`<p>Rows that give a role, a password or a code come first: ${report.rights_given}.</p>`
    }
    ${
      report.rows_left_out > 0 &&
      html`<p>
        ${report.rows_left_out} more rows are not shown:
        ${
          report.faults
            ? ' rows with errors come first.'
            : ' none of them gives a role other than trainee, another role, a password or a code.'
        }
      </p>`
    }
    <${Table} caption=${counts} head=${['Line', 'Name', 'What', 'Words', 'Column']}>${rows.map((row) => {
      const [usual, word] = kWhat[row.what],
        kind = row.column && row.what !== 'FAULT' ? 'warn' : usual; // it asks something
      return html`<tr class=${row.what === 'FAULT' ? 'row-bad' : ''}>
        <td class="number">${row.line}</td>
        <th scope="row">${row.name || '–'}</th>
        <td><${Mark} kind=${kind}>${word}<//></td>
        <td>${row.text}</td>
        <td>${row.column ?? ''}</td>
      </tr>`;
    })}<//>
  `;
}

export function PeopleImportPage() {
  const id = useId();
  const [{ csv, linesAbove }, setList, draft] = useDraft('people-import', { csv: '', linesAbove: 0 });
  const setCsv = (text) => setList((before) => ({ ...before, csv: text }));
  const [bad, setBad] = useState(false);
  const [report, setReport] = useState(null);
  const [problem, setProblem] = useState('');
  const [unread, setUnread] = useState(null);
  const action = useAction();
  const header = headerOf(csv, linesAbove),
    renames = remembered(header),
    sent = withColumns(csv, linesAbove, renames);
  const ask = async (dry_run, list = sent) => {
    const reply = await action.run(() => people.importCsv(list, linesAbove, dry_run));
    if (!reply) return;
    setReport({ ...reply, csv: list, linesAbove });
    if (!reply.done) return;
    draft.drop();
    announce(`${reply.added} people were added, ${reply.changed} changed.`);
  };
  const pick = async (event) => {
    const [file] = event.target.files;
    if (!file) return;
    setProblem(file.size > kMost_bytes ? `${file.name} is larger than 1 MiB: split it.` : '');
    setUnread(null);
    if (file.size > kMost_bytes) return;
    const bytes = await file.arrayBuffer();
    const text = textOf(bytes);
    if (text === null) setUnread({ name: file.name, bytes });
    setCsv(text ?? '');
    setReport(null);
  };
  const readAsWindows = () => {
    setCsv(textOf(unread.bytes, 'windows-1252') ?? '');
    setUnread(null);
  };
  const choose = (chosen) => {
    remember(header, chosen);
    ask(true, withColumns(csv, linesAbove, chosen));
  };
  const lines_fit = Number.isInteger(linesAbove) && linesAbove >= 0 && linesAbove <= kMost_lines;
  const current = report && report.csv === sent && report.linesAbove === linesAbove && !report.done;
  const checked = current && report.faults === 0;
  const columns = current && !renames ? columnsOf(report) : [];
  const taken = takenOf(columns);
  const no_account = columns.length > 0 && !taken.name;
  const asks = no_account || (columns.some((c) => !c.taken_as) && kChoices.some(([name]) => !taken[name]));
  return html`
    <${Heading} title="Import people" above=${html`<a href="#/people">People</a>`} />
    <p>
      A class list as it comes, with a column for the account. Columns <code>${kColumns.join(', ')}</code> are read, in
      any order, as are usual words for them in English, German and French; others are ignored. People who exist already
      are updated, not duplicated.
    </p>
    <${DraftBack} draft=${draft} />
    <div class="field">
      <label for=${id}>CSV file</label>
      <input id=${id} type="file" accept=".csv,text/csv,text/plain" onChange=${pick} />
    </div>
    <${TextField}
      label="The list"
      rows="8"
      value=${csv}
      onValue=${setCsv}
      spellcheck="false"
      placeholder=${kSample}
      wide
    />
    <${NumberField}
      label="Lines above the header"
      path="lines_above"
      most=${kMost_lines}
      whole
      value=${linesAbove}
      onValue=${(lines = 0) => setList((before) => ({ ...before, linesAbove: lines }))}
      onBad=${(_, is) => setBad(is)}
      problems=${lines_fit ? [] : [{ path: 'lines_above', message: `0 to ${kMost_lines}` }]}
    />
    ${problem && html`<p class="error"><span aria-hidden="true">✗</span> ${problem}</p>`}
    ${
      unread &&
      html`<div class="problem" role="alert">
        <p>${unread.name} is not UTF-8. Save the table as “CSV UTF-8”, or read it as spreadsheets in Western Europe write it, and check the letters:</p>
        <div class="actions">
          <button type="button" onClick=${readAsWindows}>Read it as Windows-1252</button>
        </div>
      </div>`
    }
    <${Problem} error=${action.error} />
    <div class="actions">
      <button
        type="button"
        class=${checked ? '' : 'main'}
        disabled=${!csv.trim() || !!problem || bad || !lines_fit || action.busy}
        onClick=${() => ask(true)}
      >
        Check: what will happen
      </button>
      <button type="button" class="main" disabled=${!checked || action.busy} onClick=${() => ask(false)}>Import</button>
    </div>
    ${renames && html`<${ChosenColumns} renames=${renames} again=${() => choose(null)} busy=${action.busy} />`}
    ${asks && html`<${Columns} key=${header} columns=${columns} choose=${choose} busy=${action.busy} />`}
    ${report && !no_account && html`<${Report} report=${report} />`}
  `;
}

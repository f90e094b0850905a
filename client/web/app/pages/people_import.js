// Imports a class from a CSV file; shows what will happen first.
import { readTable } from '../lib/csv.js';
import { people } from '../net/requests.js';
import { announce, Heading, Mark, Problem, Table } from '../ui/widgets.js';
import { TextField } from '../ui/fields.js';
import { useAction } from '../ui/hooks.js';
import { html, useId, useState } from '../ui/html.js';

const kColumns = ['name', 'full_name', 'role', 'group', 'password', 'code'];
const kWhat = {
  ADD: ['good', 'new'],
  CHANGE: ['warn', 'changes'],
  NOTHING: ['open', 'stays'],
  FAULT: ['bad', 'wrong'],
};
const kSample = 'name,full_name,role,group\nanna.bauer,Anna Bauer,trainee,autumn-a\n';
const kMost_bytes = 1 << 20;

/** Faults of the columns that the browser itself can find, before it asks the server. */
function complaint(csv) {
  if (!csv.trim()) return 'Choose a file, or paste the list.';
  try {
    const table = readTable(csv, kColumns);
    if (!table.columns.includes('name'))
      return `The first line has no column “name”; it has: ${table.columns.join(', ')}.`;
    if (table.unknown.length)
      return `Columns that are not known: ${table.unknown.join(', ')}. Known are: ${kColumns.join(', ')}.`;
    return table.rows.length ? '' : 'There is a header, but nobody below it.';
  } catch (error) {
    return `This is no CSV: ${error.message}.`;
  }
}

function Report({ report }) {
  const counts = `${report.added} new, ${report.changed} changed, ${report.unchanged} unchanged, ${report.faults} wrong`;
  return html`
    <h2>${report.done ? 'What happened' : 'What will happen'}</h2>
    ${
      report.done
        ? html`<div class="hint" role="status">
            <p><strong>✓ Imported:</strong> ${counts}. <a href="#/people">See the people</a></p>
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
            ? ' rows with faults come first.'
            : ' none of them gives a role other than trainee, another role, a password or a code.'
        }
      </p>`
    }
    <${Table} caption=${counts} head=${['Line', 'Name', 'What', 'Words', 'Column']}>${(report.rows ?? []).map((row) => {
      const [kind, word] = kWhat[row.what] ?? ['info', row.what];
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
  const [csv, setCsv] = useState('');
  const [report, setReport] = useState(null);
  const [file_problem, setFileProblem] = useState('');
  const action = useAction();
  const problem = file_problem || complaint(csv);
  const ask = async (dry_run) => {
    const reply = await action.run(() => people.importCsv(csv, dry_run));
    if (!reply) return;
    setReport({ ...reply, csv });
    if (reply.done) announce(`${reply.added} people were added, ${reply.changed} changed.`);
  };
  const pick = async (event) => {
    const [file] = event.target.files;
    if (!file) return;
    setFileProblem(file.size > kMost_bytes ? `${file.name} is larger than 1 MiB: split it.` : '');
    if (file.size <= kMost_bytes) setCsv(await file.text());
    setReport(null);
  };
  const checked = report && report.csv === csv && !report.done && report.faults === 0;
  return html`
    <${Heading} title="Import people" above=${html`<a href="#/people">People</a>`} />
    <p>
      Columns <code>${kColumns.join(', ')}</code> in any order; only <code>name</code> must be there. Who is there
      already is changed, never doubled.
    </p>
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
    ${csv.trim() && problem && html`<p class="error"><span aria-hidden="true">✗</span> ${problem}</p>`}
    <${Problem} error=${action.error} />
    <div class="actions">
      <button
        type="button"
        class=${checked ? '' : 'main'}
        disabled=${!!problem || action.busy}
        onClick=${() => ask(true)}
      >
        Check: what will happen
      </button>
      <button type="button" class="main" disabled=${!checked || action.busy} onClick=${() => ask(false)}>Import</button>
    </div>
    ${report && html`<${Report} report=${report} />`}
  `;
}

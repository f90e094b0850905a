// Trainee × exercise: who passed what, at a glance, with a way down to every session.
import { numbered } from '../lib/course_rules.js';
import { kExportFormats } from '../lib/export_formats.js';
import { href } from '../lib/routes.js';
import { day, moment } from '../lib/time.js';
import { verdictOf } from '../lib/verdict.js';
import { counted, csvSeparator, shownOf } from '../lib/units.js';
import { address } from '../net/api.js';
import { documents, groups, results } from '../net/requests.js';
import { SelectField } from '../ui/fields.js';
import { SearchField } from '../ui/search_field.js';
import { useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, nameCells, usePages } from '../ui/widgets.js';

/** The mark of a cell: [kind of mark, word]. */
export function cellState(cell) {
  if (cell.passed === true) return verdictOf(true);
  if (cell.locked_by.length > 0) return ['locked', 'locked'];
  if (cell.results_from_unix_ms && cell.attempts > 0) return ['info', 'taken'];
  if (cell.attempts_left === 0) return ['bad', 'no attempts left'];
  if (cell.overdue) return ['warn', 'overdue'];
  if (cell.passed === false) return verdictOf(false);
  return cell.attempts > 0 ? ['info', 'practised'] : ['open', 'not started'];
}

export function Cell({ cell, trainee, called = trainee, nameOf }) {
  const [kind, word] = cellState(cell);
  const tried = counted(cell.attempts, 'attempt');
  return html`
    <${Mark} kind=${kind}>${word}<//>
    ${
      cell.attempts > 0 &&
      html`
        <br />
        <a
          class="cell-link"
          href=${href(['progress', trainee], { exercise: cell.exercise_id })}
          aria-label=${`${tried} of ${called} at ${nameOf(cell.exercise_id)}`}
        >${tried}</a>
      `
    }
    ${
      cell.best &&
      html` · <a
          class="cell-link"
          href=${href(['sessions', cell.best.session_id])}
          aria-label=${`best session of ${called} at ${nameOf(cell.exercise_id)}`}
        >
          best
        </a>`
    }
    ${
      cell.attempts > 0 &&
      cell.attempts_left > 0 &&
      cell.passed !== true &&
      html`<br /><span class="help">${cell.attempts_left} left</span>`
    }
    ${
      cell.results_from_unix_ms &&
      html`<br /><span class="help">results from ${moment(cell.results_from_unix_ms)}</span>`
    }
    ${kind === 'locked' && html`<br /><span class="help">first: ${cell.locked_by.map(nameOf).join(', ')}</span>`}
    ${cell.due_unix_ms && cell.passed !== true && html`<br /><span class="help">due ${day(cell.due_unix_ms)}</span>`}
  `;
}

function Matrix({ course, group }) {
  const pages = usePages((page, signal) => results({ course, group, page }, signal), [course, group]);
  return html`<${Loaded} load=${pages.load}>${() => {
    const rows = pages.items,
      { exercises, trainees, passed } = pages.first;
    if (rows.length === 0)
      return html`<${Empty} title="No one has this course yet">
        <a href="#/assignments">Assign it</a> to a group or a trainee.
      <//>`;
    const nameOf = (id) => exercises.find((e) => e.id === id)?.name ?? id;
    return html`
    <div ref=${(frame) => nameCells(frame)} class="table-frame matrix" role="region" aria-label="Results" tabindex="0">
      <table>
        <caption>
          ${shownOf(rows.length, trainees, 'trainee')}, ${counted(exercises.length, 'exercise')}
        </caption>
        <thead>
          <tr>
            <th scope="col">Trainee</th>
            ${exercises.map(
              (e, i) =>
                html`<th scope="col">
                  ${numbered(i, e.name)}
                  <br />
                  <span class="unit">${passed[i] ?? 0} of ${trainees ?? rows.length} passed</span>
                </th>`,
            )}
          </tr>
        </thead>
        <tbody>${rows.map(
          (row) => html`<tr key=${row.trainee}>
            <th scope="row">
              <a href=${href(['progress', row.trainee])}>${row.full_name || row.trainee}</a>
              <br />
              <span class="unit">
                ${row.cells.filter((c) => c.passed === true).length} of ${exercises.length} passed
              </span>
            </th>
            ${exercises.map((e) => {
              const cell = row.cells.find((c) => c.exercise_id === e.id);
              return html`<td>${
                cell
                  ? html`<${Cell} cell=${cell} trainee=${row.trainee} called=${row.full_name || row.trainee} nameOf=${nameOf} />`
                  : '–'
              }</td>`;
            })}
          </tr>`,
        )}</tbody>
      </table>
    </div>
    ${pages.button}`;
  }}<//>`;
}

export function ResultsPage({ query }) {
  const load = useLoad((signal) => documents('courses').all(signal), []);
  const [named, setNamed] = useState(null);
  const course = query.course ?? load.data?.[0]?.id,
    group = query.group ?? '';
  const go = (key) => (value) => {
    location.hash = href(['results'], { course, group, [key]: value });
  };
  return html`
    <${Heading} title="Results">${
      course &&
      html`
        ${kExportFormats.results.map(
          (f) => html`
            <a
              class="button"
              href=${address(['courses', course, `results${f.suffix}`], { group, separator: csvSeparator() })}
              download
            >
              Spreadsheet (${f.title})
            </a>
          `,
        )}
        ${kExportFormats.scores.map(
          (f) =>
            html`<a class="button" href=${address([`scores${f.suffix}`], { course, group })} download>Scores as ${f.title}</a>`,
        )}
      `
    }<//>
    <${Loaded} load=${load}>${(courses) =>
      courses.length === 0
        ? html`<${Empty} title="There are no courses yet"><a href="#/courses">Make one</a>, then assign it.<//>`
        : html`
            <div class="filters">
              <${SelectField}
                label="Course"
                value=${course}
                options=${courses.map((c) => [c.id, c.name])}
                onValue=${go('course')}
              />
              <${SearchField}
                label="Group"
                chosen=${group && named?.key === group ? named : group ? { key: group, text: group } : null}
                find=${groups.find}
                placeholder="All trainees"
                onChoose=${(chosen) => {
                  setNamed(chosen);
                  go('group')(chosen?.key ?? '');
                }}
              />
            </div>
            <${Matrix} course=${course} group=${group} />
          `}<//>
  `;
}

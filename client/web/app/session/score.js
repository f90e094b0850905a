// The verdict with its sentence, and the score: values, requirements, and the experts' range.
import { kMeasures } from '../lib/measure_rows.js';
import {
  isOfTissueNotMet,
  measureText,
  placeMarks,
  placeWords,
  requirementText,
  rowRemark,
  rowTitle,
} from '../lib/measures.js';
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { layerNames } from '../lib/tissue.js';
import { counted } from '../lib/units.js';
import { stiffnessShareText, verdictOf } from '../lib/verdict.js';
import { moment } from '../lib/time.js';
import { measures, references, sessions } from '../net/requests.js';
import { announce, Loaded, Mark, number as right, Problem, Table } from '../ui/widgets.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';
import { Verdict } from '../pages/sessions.js';

/** The experts' range as a bar, the value as a diamond; the words beside it say the same. */
function Place({ beside }) {
  const marks = placeMarks(beside);
  const x = (share) => 120 * share;
  return html`<svg class="band" viewBox="0 0 120 18" aria-hidden="true">
    <line class="band-axis" x1="2" x2="118" y1="9" y2="9" />
    <rect
      class="band-range"
      x=${x(marks.least)}
      y="4"
      width=${Math.max(1, x(marks.greatest - marks.least))}
      height="10"
    />
    <path class="band-value" d=${`M${x(marks.value)} 2l4 7-4 7-4-7z`} />
  </svg>`;
}

/**
 * @param {{row: any, title: string, beside: any, experts: number}} props `beside`: the server's comparison with the
 * experts, if it has one; `experts`: their number in the table's head
 */
export function Row({ row, title, beside, experts }) {
  const remark = rowRemark(row);
  return html`<tr>
    <th scope="row">
      ${title}
      ${remark && html`<p class="explained">${remark}</p>`}
    </th>
    <td class="number">${row.value === null ? 'not measured' : measureText(row.measure, row.value, row.unit)}${row.incomplete ? ' (incomplete)' : ''}</td>
    <td>${requirementText(row) || '–'}</td>
    <td>${
      row.passed === undefined
        ? ''
        : row.passed
          ? html`<${Mark} kind="good">met<//>`
          : html`<${Mark} kind="bad">not met<//>`
    }</td>
    <td>${
      beside?.place
        ? html`
            <${Place} beside=${beside} />
            <p class="explained">${placeWords(beside, experts)}</p>
          `
        : ''
    }</td>
  </tr>`;
}

/**
 * The score of a session and its exercise's reference, null without one; of an exam, once it is shown; `kinds`: the
 * measures by name.
 */
export function useScore({ description: { session_id, exercise_id }, results_from_unix_ms }) {
  return useLoad(
    async (signal) => {
      const orNone = (error) => {
        if (error.kind !== 'not_found') throw error;
        return null;
      };
      const [score, reference, kinds] = await Promise.all([
        results_from_unix_ms ? null : sessions.score(session_id, signal).catch(orNone),
        exercise_id ? references.one(exercise_id, signal).catch(orNone) : null,
        measures(signal),
      ]);
      return { score, reference, kinds };
    },
    [session_id],
  );
}

const judgedOf = (rows) => rows.filter((r) => typeof r.passed === 'boolean');

/** One sentence about the verdict. @param {any} session @param {{score: any, kinds: any[]}} judged of useScore */
function sentenceOf(session, { score, kinds }) {
  if (session.results_from_unix_ms) return 'This is an exam: your result and its recording are shown from then on.';
  if (session.state === 'SESSION_OPEN')
    return 'This session is still being recorded: below is what has arrived so far.';
  if (!score?.measures?.length) return 'There is no score yet: it is made when the session is closed.';
  const judged = judgedOf(score.measures),
    missed = judged.filter((r) => !r.passed);
  if (judged.length === 0) return 'Nothing was required.';
  if (missed.length === 0)
    return judged.length === 1 ? 'The requirement is met.' : `All ${judged.length} requirements are met.`;
  const titles = missed.map((row) => rowTitle(row, kinds, layerNames(session.description.profile)));
  return `${missed.length} of ${counted(judged.length, 'requirement')} ${missed.length === 1 ? 'is' : 'are'} not met: ${titles.join(', ')}.`;
}

/** The verdict and one sentence about it. @param {{session: any, load: any}} props `load`: of useScore */
export function Judgement({ session, load: { data } }) {
  const of = data && !session.results_from_unix_ms ? { passed: data.score?.passed } : session;
  return html`<p class="judgement"><${Verdict} of=${of} /> ${data && sentenceOf(session, data)}</p>`;
}

/** Nothing before there is a score. @param {{session: any, exercise: string, load: any, person: any}} props `exercise`: its name; `load`: of useScore */
export function Score({ session, exercise, load, person }) {
  const { session_id, exercise_id } = session.description;
  const lowered = stiffnessShareText(session.description);
  const action = useAction();
  const rescore = async () => {
    const score = await action.run(() => sessions.rescore(session_id));
    if (!score) return;
    load.reload();
    announce(`Scored again, by definitions ${score.definition_version}.`);
  };
  const chosen = load.data?.reference?.session_ids ?? [];
  const mark = async () => {
    const next = chosen.includes(session_id) ? chosen.filter((id) => id !== session_id) : [...chosen, session_id];
    const reference = await action.run(() => references.put(exercise_id, next, load.data.reference?.revision ?? 0));
    if (!reference) return;
    load.reload();
    announce(`${counted(next.length, 'session makes', 'sessions make')} the reference of ${exercise} now.`);
  };
  return html`<${Loaded} load=${load}>${({ score, reference, kinds }) => {
    const rows = score?.measures ?? [];
    if (rows.length === 0) return null;
    const judged = judgedOf(rows),
      experts = reference?.session_ids?.length ?? 0;
    const layers = layerNames(session.description.profile),
      titleOf = (row) => rowTitle(row, kinds, layers);
    const besideOf = (row) => score.comparison?.find((c) => c.measure === row.measure);
    // the distance from the experts' paths is measured each time, no matter when the experts were chosen
    const path = besideOf({ measure: kMeasures.expert_path }) ?? rows.find((r) => r.measure === kMeasures.expert_path);
    const others = rows.filter(
      (r) => typeof r.passed !== 'boolean' && !(path && r.measure === kMeasures.expert_path) && !isOfTissueNotMet(r),
    );
    const table = (caption, list) => html`<${Table}
        caption=${caption}
        head=${['Measure', right('Value'), 'Required', 'Verdict', `Experts (${experts})`]}
      >${list.map(
        (row) =>
          html`<${Row} key=${row.measure} row=${row} title=${titleOf(row)} beside=${besideOf(row)} experts=${experts} />`,
      )}<//>`;
    return html`<section aria-labelledby="score-title">
        <h2 id="score-title">Score</h2>
        ${
          rows.some((r) => r.incomplete) &&
          html`<p><${Mark} kind="warn">incomplete<//> The station stood still for a while: a part of the recording is missing, and no requirement on it can be met. Staff can excuse the attempt.</p>`
        }
        ${lowered && html`<p>${lowered}</p>`}
        ${
          path &&
          html`<p>
            Path of the tip: <strong>${measureText(path.measure, path.value, 'm')}</strong> on average from the nearest expert's
            (DTW)${besideOf(path)?.place && `, ${placeWords(besideOf(path), experts)}`}.
          </p>`
        }
        ${
          score.pending?.length > 0 &&
          html`<p class="help">
            The path's distance from long gestures of experts is not computed yet: load the page again.
          </p>`
        }
        ${judged.length > 0 && table('Measures that were required', judged)}
        ${
          judged.length > 0 && others.length > 0
            ? html`<details>
                <summary>${counted(others.length, 'further measure')}</summary>
                ${table('Further measures', others)}
              </details>`
            : others.length > 0 && table('Measures', others)
        }
        ${
          score.definition_version &&
          html`<p class="help">By definitions ${score.definition_version}, made ${moment(score.made_unix_ms)}.${
            score.passed !== session.passed && ` The first score: ${verdictOf(session.passed)[1]}.`
          }</p>`
        }
        <${Problem} error=${action.error} />
        <div class="actions">
          ${
            may(person.role, 'set reference') &&
            exercise_id &&
            html`<button type="button" disabled=${action.busy} onClick=${mark}>${
              chosen.includes(session_id) ? 'Take out of the reference' : 'Use as an expert reference'
            }</button>`
          }
          ${
            may(person.role, 'rescore') &&
            html`<button type="button" disabled=${action.busy} onClick=${rescore}>
              Score again by today's definitions
            </button>`
          }
          ${
            may(person.role, 'set reference') &&
            exercise_id &&
            html`<a class="button" href=${href(['references', exercise_id])}>All experts of this exercise</a>`
          }
        </div>
      </section>`;
  }}<//>`;
}

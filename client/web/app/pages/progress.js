// One trainee's attempts over time, and whether they improve.
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { quantityOfUnit } from '../lib/axis.js';
import { kMeasures } from '../lib/measure_rows.js';
import { measureText, rowTitle, shownUnit } from '../lib/measures.js';
import { shownOf } from '../lib/units.js';
import { moment } from '../lib/time.js';
import { kCurves } from '../lib/tissue.js';
import { trendOf } from '../lib/verdict.js';
import { exercises, measures as measuresOfScores, people } from '../net/requests.js';
import { Chart } from '../ui/chart.js';
import { SelectField } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useMemo } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, Table, usePages } from '../ui/widgets.js';
import { Excuse } from '../session/excuse.js';
import { Forbidden } from './forbidden.js';
import { Verdict } from './sessions.js';

const scoreOf = (attempt) => attempt.score ?? attempt.measures ?? [];

/** `attempts`: oldest first. */
function Curve({ attempts, measure, titleOf }) {
  const drawn = useMemo(() => {
    const rows = attempts.map((a) => scoreOf(a).find((r) => r.measure === measure));
    const row = rows.find(Boolean),
      { factor, unit } = shownUnit(measure, row?.unit ?? '');
    const shown = (v) => (v === null || v === undefined ? null : v / factor);
    const title = row ? titleOf(row) : 'unknown measure',
      label = unit ? `${title} (${unit})` : title;
    const series = [{ label, values: rows.map((r) => shown(r?.value)), ...kCurves[0] }];
    for (const [key, word, curve] of [
      ['min', 'at least', kCurves[2]],
      ['max', 'at most', kCurves[1]],
    ]) {
      const bound = rows.find((r) => r?.[key] !== undefined)?.[key];
      if (bound !== undefined)
        series.push({ label: `required: ${word}`, values: rows.map(() => shown(bound)), ...curve });
    }
    const said = rows
      .map((r, i) => `attempt ${attempts[i].number}: ${measureText(measure, r?.value, r?.unit ?? '')}`)
      .join(', ');
    return {
      title: `${title} over attempts`,
      y_label: label,
      quantity: quantityOfUnit(unit),
      series,
      summary: `${title}, ${said}`,
      x: { label: 'Attempt', values: attempts.map((a) => a.number) },
    };
  }, [attempts, measure, titleOf]);
  return html`<${Chart} ...${drawn} points />`;
}

function Attempts({ name, exercise, total, measure, go, me }) {
  const pages = usePages((page, signal) => people.attempts(name, exercise, page, signal), [name, exercise]);
  return html`<${Loaded} load=${pages.load}>${() => html`
    <${Shown}
      attempts=${pages.items}
      total=${total}
      trends=${pages.first?.measures}
      exercise=${exercise}
      measure=${measure}
      go=${go}
      me=${me}
      reload=${pages.load.reload}
    />
    ${pages.button}
  `}<//>`;
}

/** `attempts`: the newest ones of `total`, newest first. */
function Shown({ attempts, total, trends, exercise, measure, go, me, reload }) {
  const kinds = useLoad((signal) => measuresOfScores(signal), []).data;
  const titleOf = useMemo(() => (row) => rowTitle(row, kinds ?? []), [kinds]);
  const measures = useMemo(() => {
    const all = new Map();
    for (const attempt of attempts)
      for (const row of scoreOf(attempt)) if (!all.has(row.measure)) all.set(row.measure, titleOf(row));
    return [...all];
  }, [attempts, titleOf]);
  const excuses = may(me.role, 'excuse');
  const chosen =
    measure && measures.some(([name]) => name === measure)
      ? measure
      : (measures.find(([name]) => name === kMeasures.force)?.[0] ?? measures[0]?.[0]);
  const trend = trends?.find((row) => row.measure === chosen);
  return html`
    ${
      chosen &&
      html`
        <div class="filters">
          <${SelectField} label="Measure" value=${chosen} options=${measures} onValue=${(m) => go(exercise, m)} />
        </div>
        ${trend && html`<p class="judgement"><${Mark} kind=${trendOf(trend)[0]}>${trendOf(trend)[1]}<//></p>`}
        <${Curve} attempts=${[...attempts].reverse()} measure=${chosen} titleOf=${titleOf} />
        ${trend && html`<details><summary>How it was computed</summary><p class="explained">${trend.words}</p></details>`}
      `
    }
    <${Table}
      caption=${`${shownOf(attempts.length, total, 'attempt')}, newest first`}
      head=${[
        'Attempt',
        'Begun',
        'Verdict',
        'Not met',
        'Remarks',
        ...(excuses ? [html`<span class="visually-hidden">Actions</span>`] : []),
      ]}
    >${attempts.map(
      (a) => html`<tr key=${a.session_id}>
        <th scope="row"><a href=${href(['sessions', a.session_id])}>Attempt ${a.number}</a></th>
        <td>${moment(a.started_unix_ms)}</td>
        <td><${Verdict} of=${a} /></td>
        <td class="long">${
          scoreOf(a)
            .filter((r) => r.passed === false)
            .map(titleOf)
            .join(', ') || '–'
        }</td>
        <td>
          ${a.excused && html`<${Mark} kind="info">${a.beyond ? 'beyond the limit' : 'does not count'}<//>`}
          ${a.late && html`<${Mark} kind="warn">late<//>`}
        </td>
        ${excuses && html`<td>${!a.beyond && html`<${Excuse} attempt=${a} done=${reload} />`}</td>`}
      </tr>`,
    )}<//>
  `;
}

export function Progress({ name, query, base, me }) {
  const load = useLoad((signal) => people.tried(name, signal), [name]);
  const known = useLoad((signal) => exercises(signal), []);
  const go = (exercise, measure) => {
    location.hash = href(base, { exercise, measure });
  };
  return html`<${Loaded} load=${load}>${(all) => {
    const nameOf = (id) => known.data?.find((e) => e.id === id)?.name ?? id;
    if (all.length === 0)
      return html`<${Empty} title="No attempts yet">They appear here after the first practice at a station.<//>`;
    const { exercise_id: exercise, attempts } = all.find((t) => t.exercise_id === query.exercise) ?? all[0];
    return html`
      <div class="filters">
        <${SelectField}
          label="Exercise"
          value=${exercise}
          options=${all.map((t) => [t.exercise_id, nameOf(t.exercise_id)])}
          onValue=${(e) => go(e, query.measure)}
        />
      </div>
      <${Attempts}
        name=${name}
        key=${exercise}
        exercise=${exercise}
        total=${attempts}
        measure=${query.measure}
        go=${go}
        me=${me}
      />
    `;
  }}<//>`;
}

export function ProgressPage({ params, query, person }) {
  const own = params.name === person.name;
  const shown = useLoad(
    async (signal) => (!own && may(person.role, 'see people') ? people.one(params.name, signal) : null),
    [params.name],
  );
  if (!own && !may(person.role, 'see results'))
    return html`<${Forbidden} person=${person} path=${`/progress/${params.name}`} />`;
  return html`
    <${Heading}
      title=${own ? 'My progress' : `Progress of ${shown.data?.full_name || params.name}`}
      above=${own ? html`<a href="#/mine">My results</a>` : html`<a href="#/results">Results</a>`}
    />
    <${Progress} name=${params.name} query=${query} base=${['progress', params.name]} me=${person} />
  `;
}

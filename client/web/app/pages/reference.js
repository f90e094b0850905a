// The experts of one exercise: their sessions, to which all others are compared, and the bands made from them.
import { traineeName } from '../lib/lab.js';
import { meanText, measureNamed } from '../lib/measures.js';
import { href } from '../lib/routes.js';
import { layerNames } from '../lib/tissue.js';
import { clock, moment } from '../lib/time.js';
import { counted, number } from '../lib/units.js';
import { documents, exercises, measures, references, sessions } from '../net/requests.js';
import { announce, Empty, Heading, Loaded, number as right, Problem, Table, usePages } from '../ui/widgets.js';
import { CheckField } from '../ui/fields.js';
import { DraftBack, useDraft } from '../ui/draft.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';
import { Verdict } from './sessions.js';

/** @param {{reference: any, title: (measure: string) => string}} props */
function Bands({ reference, title }) {
  if (!reference.bands?.length)
    return html`<${Empty} title="No bands yet">
      Choose sessions of experts above: the bands are made from their scores.
    <//>`;
  const later = (reference.pending ?? []).map(title).join(', ');
  return html`${later && html`<p class="help">Not computed yet: ${later}. Long gestures take several tries: load the page again.</p>`}<${Table}
    caption=${`Bands by definitions ${reference.definition_version}, of ${counted(reference.session_ids.length, 'session')}; percentiles need five`}
    head=${[
      'Measure',
      ...['Sessions', 'Mean', 'Standard deviation', 'Least', '10 %', 'Median', '90 %', 'Greatest'].map(right),
    ]}
  >${reference.bands.map(
    (b) => html`<tr key=${b.measure}>
      <th scope="row">${title(b.measure)}</th>
      <td class="number">${number(b.n)}</td>
      ${[b.mean, b.sd, b.least, b.p10, b.median, b.p90, b.greatest].map(
        (v) => html`<td class="number">${meanText(b.measure, v, b.unit)}</td>`,
      )}
    </tr>`,
  )}<//>`;
}

function Choice({ exercise, name, reference, reload }) {
  const [chosen, setChosen, draft] = useDraft(`reference/${exercise}`, reference.session_ids ?? [], reference.revision);
  const pages = usePages((page, signal) => sessions.page({ exercise, page }, signal), [exercise]);
  const action = useAction();
  const changed = [...chosen].sort().join() !== [...(reference.session_ids ?? [])].sort().join();
  const toggle = (id) => (on) => setChosen(on ? [...chosen, id] : chosen.filter((c) => c !== id));
  const save = async () => {
    if (!(await action.run(() => references.put(exercise, chosen, draft.base)))) return;
    draft.drop();
    announce(`${counted(chosen.length, 'session makes', 'sessions make')} the reference of ${name} now.`);
    reload();
  };
  // some may be beyond the loaded part of the list
  const elsewhere = chosen.filter((id) => !pages.items.some((s) => s.description.session_id === id));
  return html`
    <${DraftBack} draft=${draft} />
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`<${Empty} title="No one has practised this exercise yet">
            Let an expert practise it at a station; then choose the session here.
          <//>`
        : html`
            <${Table}
              caption="Sessions of this exercise, newest first"
              head=${['Expert', 'Trainee', 'Begun', 'Station', right('Length'), 'Verdict']}
            >${pages.items.map((s) => {
              const d = s.description;
              return html`<tr key=${d.session_id}>
                <td>
                  <${CheckField}
                    label=${html`<span
                      class="visually-hidden"
                    >${`${traineeName(d)}, ${moment(d.started_unix_ms)} is an expert's`}</span>`}
                    checked=${chosen.includes(d.session_id)}
                    onValue=${toggle(d.session_id)}
                  />
                </td>
                <th scope="row">${traineeName(d)}</th>
                <td><a href=${href(['sessions', d.session_id])}>${moment(d.started_unix_ms)}</a></td>
                <td>${d.station}</td>
                <td class="number">${clock(s.samples / d.rate_hz)}</td>
                <td><${Verdict} of=${s} /></td>
              </tr>`;
            })}<//>
            ${pages.button}
          `}<//>
    ${
      elsewhere.length > 0 &&
      html`<p class="help">
        Chosen, and not in the list
        above: ${elsewhere.map(
          (id, i) => html`${i > 0 && ', '}<a href=${href(['sessions', id])}>session ${i + 1}</a>`,
        )}.
      </p>`
    }
    ${
      action.error?.kind === 'conflict'
        ? html`<div class="problem" role="alert">
            <p>
              <strong>Someone else chose other sessions in the meantime.</strong> Your choice is still here; nothing
              was saved.
            </p>
            <button
              type="button"
              onClick=${() => {
                action.clear();
                draft.discard();
                reload();
              }}
            >
              Show the current choice
            </button>
          </div>`
        : html`<${Problem} error=${action.error} />`
    }
    <div class="actions">
      <button type="button" class="main" disabled=${!changed || action.busy} onClick=${save}>Save the choice</button>
      <span role="status">${chosen.length} chosen</span>
    </div>
  `;
}

export function ReferencePage({ params }) {
  const { exercise } = params;
  const load = useLoad(
    async (signal) => {
      const [reference, kinds, all] = await Promise.all([
        references.one(exercise, signal),
        measures(signal),
        exercises(signal),
      ]);
      const own = all.find((e) => e.id === exercise),
        patient = own?.profile_id;
      const layers = patient ? layerNames((await documents('profiles').one(patient, undefined, signal)).json) : [];
      return {
        reference,
        name: own?.name || exercise,
        title: (measure) => measureNamed(kinds, measure, layers)?.words ?? 'unknown measure',
      };
    },
    [exercise],
  );
  return html`
    <${Heading} title=${load.data ? `Experts of ${load.data.name}` : 'Experts'} above=${html`<a href="#/results">Results</a>`} />
    <p>
      Every score of this exercise is placed in the range of these sessions, value by value; the path of the tip by its
      distance (DTW) from the nearest expert's. A session in which a hazard or bone was touched cannot be chosen.
    </p>
    <${Loaded} load=${load}>${({ reference, name, title }) => html`
      <${Choice} key=${reference.revision} exercise=${exercise} name=${name} reference=${reference} reload=${load.reload} />
      ${
        reference.changed_by &&
        html`<p class="help">Chosen by ${reference.changed_by}, ${moment(reference.changed_unix_ms)}.</p>`
      }
      <h2>Bands</h2>
      <${Bands} reference=${reference} title=${title} />
    `}<//>
  `;
}

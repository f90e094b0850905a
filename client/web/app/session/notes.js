// Remarks at moments of the session, and the syringe's aspirations and injections.
import { may } from '../lib/roles.js';
import { clock, moment } from '../lib/time.js';
import { atStart, quantity, words } from '../lib/units.js';
import { sessions } from '../net/requests.js';
import { announce, Empty, Loaded, number, Problem, Table } from '../ui/widgets.js';
import { TextField } from '../ui/fields.js';
import { DraftBack, useDraft } from '../ui/draft.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';

/** @param {{id: string, at_s: number, seek: (s: number) => void, load: any, person: any}} props `load`: of the annotations */
export function Annotations({ id, at_s, seek, load, person }) {
  const [text, setText, draft] = useDraft(`annotation/${id}`, '');
  const action = useAction();
  const save = async (event) => {
    event.preventDefault();
    if (!(await action.run(() => sessions.annotate(id, at_s, text.trim())))) return;
    draft.discard();
    announce(`The remark at ${clock(at_s)} was saved.`);
    load.reload();
  };
  return html`<section aria-labelledby="notes-title">
    <h2 id="notes-title">Annotations</h2>
    <${Loaded} load=${load}>${(all) =>
      all.length === 0
        ? html`<${Empty} title="No remarks yet">${
            may(person.role, 'annotate') ? 'Move the replay to a moment and write one below.' : ''
          }<//>`
        : html`<ul class="notes">${all.map(
            (a) =>
              html`<li key=${a.id}>
                ${
                  seek
                    ? html`<button
                        type="button"
                        class="small"
                        aria-label=${`${clock(a.t_s)}: go to this moment`}
                        onClick=${() => seek(a.t_s)}
                      >${clock(a.t_s)}</button>`
                    : clock(a.t_s)
                } <span>${a.text}</span> <span class="help">
                  ${a.author}, ${moment(a.created_unix_ms)}
                </span>
              </li>`,
          )}</ul>`}<//>
    ${
      may(person.role, 'annotate') &&
      html`<form onSubmit=${save}>
        <${DraftBack} draft=${draft} />
        <${TextField} label=${`Remark at ${clock(at_s)}`} rows="2" value=${text} onValue=${setText} required wide />
        <${Problem} error=${action.error} />
        <div class="actions">
          <button type="submit" disabled=${action.busy || !text.trim()}>Add at ${clock(at_s)}</button>
        </div>
      </form>`
    }
  </section>`;
}

export function SyringeEvents({ id, seek }) {
  const load = useLoad((signal) => sessions.events(id, signal), [id]);
  const percent = (share) => quantity(share, 'share');
  return html`<section aria-labelledby="syringe-title">
    <h2 id="syringe-title">Syringe</h2>
    <${Loaded} load=${load}>${(all) =>
      all.length === 0
        ? html`<${Empty} title="The plunger was not moved" />`
        : html`<${Table}
            caption="Aspirations and injections"
            hide_caption
            head=${['When', 'What', number('How much'), 'Where', number('In the target')]}
          >${all.map(
            (e, i) => html`<tr key=${i}>
              <td>
                <button
                  type="button"
                  class="small"
                  aria-label=${`${clock(e.begin_s)}: go to this moment`}
                  onClick=${() => seek(e.begin_s)}
                >${clock(e.begin_s)}</button>
              </td>
              <th scope="row">${words(e.kind)}</th>
              <td class="number">${percent(Math.abs(e.plunger_to - e.plunger_from))}</td>
              <td>
                ${e.begin?.in_tissue ? `${atStart(e.begin.layer_name || words(e.begin.tissue))}, ${quantity(e.begin.depth_m, 'm')} deep` : 'outside'}
                ${e.hazards?.length ? html` <span class="error">✗ in ${e.hazards.join(', ')}</span>` : ''}
              </td>
              <td class="number">${percent(e.in_target_share)}</td>
            </tr>`,
          )}<//>`}<//>
  </section>`;
}

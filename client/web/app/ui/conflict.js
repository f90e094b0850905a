// Two people changed the same document: both versions, field by field; nothing is lost.
import { moment } from '../lib/time.js';
import { counted } from '../lib/units.js';
import { html, useState } from './html.js';
import { Dialog, Table } from './widgets.js';

/** A value of a document as text for a table. */
export function valueText(value) {
  if (value === undefined) return '(nothing)';
  return typeof value === 'string' ? value : JSON.stringify(value);
}

/** @param {{conflict: any, settle: (choice: any, and_save: boolean) => void, close: () => void}} props */
export function ConflictDialog({ conflict, settle, close }) {
  const [choice, setChoice] = useState({});
  const { theirs, clashes, taken } = conflict;
  const open = clashes.filter((clash) => !choice[clash.path]).length;
  const all = (side) => setChoice(Object.fromEntries(clashes.map((clash) => [clash.path, side])));
  return html`<${Dialog} title="Someone else saved first" close=${close} wide>
    <p>
      <strong>${theirs.author || 'Someone'}</strong> saved revision ${theirs.revision}
      ${theirs.created_unix_ms ? ` on ${moment(theirs.created_unix_ms)}` : ''} while you were editing. Nothing of yours
      is lost.
    </p>
    ${
      clashes.length > 0 &&
      html`
        <h3>Both of you changed these: choose</h3>
        <div class="actions">
          <button type="button" class="small" onClick=${() => all('mine')}>All mine</button>
          <button type="button" class="small" onClick=${() => all('theirs')}>All theirs</button>
        </div>
        <${Table} caption="Fields that both changed" head=${['Field', 'Before', 'Mine', 'Theirs']}>${clashes.map(
          (clash) => html`<tr key=${clash.path}>
            <th scope="row"><code>${clash.path || 'all'}</code></th>
            <td class="long">${valueText(clash.base)}</td>
            ${['mine', 'theirs'].map(
              (side) => html`<td class="long">
                <label class="side">
                  <input
                    type="radio"
                    name=${'side-' + clash.path}
                    checked=${choice[clash.path] === side}
                    onChange=${() => setChoice({ ...choice, [clash.path]: side })}
                    aria-label=${`${side === 'mine' ? 'Keep mine' : 'Take theirs'} for ${clash.path}: ${valueText(clash[side])}`}
                  /> ${valueText(clash[side])}
                </label>
              </td>`,
            )}
          </tr>`,
        )}<//>
      `
    }
    ${
      taken.length > 0 &&
      html`
        <h3>Changed by ${theirs.author || 'them'} alone: taken over</h3>
        <${Table} caption="Their changes" head=${['Field', 'Before', 'Now']}>${taken.map(
          (c) =>
            html`<tr key=${c.path}>
              <th scope="row"><code>${c.path}</code></th>
              <td class="long">${valueText(c.before)}</td>
              <td class="long">${valueText(c.after)}</td>
            </tr>`,
        )}<//>
      `
    }
    ${clashes.length + taken.length === 0 && html`<p>Both of you made the same changes.</p>`}
    <div class="actions">
      <button type="button" class="main" disabled=${open > 0} onClick=${() => settle(choice, true)}>
        Save both together
      </button>
      <button type="button" disabled=${open > 0} onClick=${() => settle(choice, false)}>
        Merge and keep editing
      </button>
      <button type="button" onClick=${close}>Back, decide later</button>
      ${open > 0 && html`<span class="help">${counted(open, 'choice')} left</span>`}
    </div>
  <//>`;
}

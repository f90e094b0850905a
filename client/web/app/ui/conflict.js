// Two people changed the same document: both versions, field by field; nothing is lost.
import { placeWords, valueWords } from '../lib/plain_words.js';
import { moment } from '../lib/time.js';
import { counted } from '../lib/units.js';
import { html, useState } from './html.js';
import { Dialog, Table } from './widgets.js';

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
            <th scope="row">${placeWords(clash.path)}</th>
            <td class="long">${valueWords(clash.base, clash.path)}</td>
            ${['mine', 'theirs'].map(
              (side) => html`<td class="long">
                <label class="side">
                  <input
                    type="radio"
                    name=${'side-' + clash.path}
                    checked=${choice[clash.path] === side}
                    onChange=${() => setChoice({ ...choice, [clash.path]: side })}
                    aria-label=${`${side === 'mine' ? 'Keep mine' : 'Take theirs'} for ${placeWords(clash.path)}: ${valueWords(clash[side], clash.path)}`}
                  /> ${valueWords(clash[side], clash.path)}
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
              <th scope="row">${placeWords(c.path)}</th>
              <td class="long">${valueWords(c.before, c.path)}</td>
              <td class="long">${valueWords(c.after, c.path)}</td>
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

// Codes of trainees: a PIN, or what a badge reader types. One person's code, and whether the lab requires codes.
import { digitOnTheKey } from '../../lib/presses.js';
import { lab, people } from '../../net/requests.js';
import { announce, DangerButton, Dialog, Loaded, Mark, Problem } from '../../ui/widgets.js';
import { CheckField, TextField } from '../../ui/fields.js';
import { useAction, useLoad } from '../../ui/hooks.js';
import { html, useState } from '../../ui/html.js';

/** A made PIN; the server keeps only its hash. */
function NewPin({ made, full_name, close }) {
  return html`<${Dialog} title="A new code" close=${close}>
    <p>${full_name ? `${full_name} (${made.name})` : made.name}</p>
    <p class="pin"><output aria-label=${`PIN of ${made.name}`}>${made.code}</output></p>
    <p>It is shown only once. Write it down or hand it over now.</p>
    <div class="actions"><button type="button" class="main" onClick=${close}>Close</button></div>
  <//>`;
}

/** @param {{shown: any, load: any}} props `shown`: a person; `load` of that person */
export function CodeForm({ shown, load }) {
  const [code, setCode] = useState('');
  const [made, setMade] = useState(null);
  const action = useAction();
  const { name, has_code } = shown;
  const ask = async (change, has, text) => {
    const reply = await action.run(() => people.setCode(name, change));
    if (!reply) return;
    setCode('');
    load.setData({ ...shown, has_code: has });
    announce(text);
    if (change.make) setMade(reply);
  };
  const save = (event) => {
    event.preventDefault();
    ask({ code }, true, `The code of ${name} was set.`);
  };
  const fault = action.error?.field === 'code' ? [{ path: 'code', message: action.error.said }] : [];
  return html`<form onSubmit=${save}>
    <fieldset>
      <legend>Code</legend>
      <p>${has_code ? html`<${Mark} kind="good">has a code<//>` : html`<${Mark} kind="open">no code<//>`}</p>
      <p class="help">
        A station asks for it before a lesson, so that no one else practises as ${name}. A badge reader types the
        badge's code.
      </p>
      <${TextField}
        label="Badge or PIN"
        help="4 to 64 characters; hold the badge to a reader here"
        onKeyDown=${digitOnTheKey(setCode)}
        type="password"
        autocomplete="new-password"
        path="code"
        value=${code}
        onValue=${setCode}
        problems=${fault}
      />
      <${Problem} error=${fault.length ? null : action.error} />
      <div class="actions">
        <button type="submit" disabled=${action.busy || !code}>Set the code</button>
        <button
          type="button"
          disabled=${action.busy}
          onClick=${() => ask({ make: true }, true, `${name} has a new code.`)}
        >
          Give a code
        </button>
        ${
          has_code &&
          html`<${DangerButton}
            text="Remove code"
            disabled=${action.busy}
            title=${`Remove the code of ${name}?`}
            word="Remove"
            act=${() => ask({ code: '' }, false, `${name} no longer has a code.`)}
          >
            Stations then do not ask ${name} for one; where codes are required, ${name} cannot practise. You can set a new
            one.
          <//>`
        }
      </div>
      ${made && html`<${NewPin} made=${made} full_name=${shown.full_name} close=${() => setMade(null)} />`}
    </fieldset>
  </form>`;
}

/** Whether trainees without a code may practise. */
export function CodesRequired() {
  const load = useLoad((signal) => lab.settings(signal), []);
  const action = useAction();
  const set = async (codes_required) => {
    const settings = await action.run(() => lab.change({ codes_required }));
    if (!settings) return;
    load.setData(settings);
    announce(codes_required ? 'Codes are required now.' : 'Codes are optional now.');
  };
  return html`<fieldset>
    <legend>Codes of trainees</legend>
    <p>
      A station asks a trainee who has a code for it. Where codes are required, a trainee without one can practise only
      as a guest.
    </p>
    <${Loaded} load=${load}>${(settings) =>
      html`<${CheckField}
        label="Codes are required"
        checked=${settings.codes_required}
        disabled=${action.busy}
        onValue=${set}
        help="Give everyone a code first: on each person’s page, or by a column “code” in an imported list. Existing codes stay."
      />`}<//>
    <${Problem} error=${action.error} />
  </fieldset>`;
}

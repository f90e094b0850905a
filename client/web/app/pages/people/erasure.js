// A person's erasure, what remains, and others' texts that name the person.
import { lab, people } from '../../net/requests.js';
import { announce, Confirm, DangerButton, Mark, Problem, Table } from '../../ui/widgets.js';
import { CheckField, TextField } from '../../ui/fields.js';
import { DraftBack, draftOf, useDraft } from '../../ui/draft.js';
import { useAction, useLoad } from '../../ui/hooks.js';
import { html, useState } from '../../ui/html.js';

/** Remarks, titles and notes that name the person; nothing changes them automatically. */
function Mentions({ name, text, setText }) {
  const [found, setFound] = useState(null);
  const action = useAction();
  const look = async () => {
    const all = await action.run(() => people.mentions(name, text));
    if (all) setFound(all);
  };
  const redact = async (one) => {
    await people.redact(name, text, one.where);
    announce(`The name was removed from ${one.about}.`);
    setFound((before) => before.filter((other) => other.where !== one.where));
  };
  return html`
    <p>Remarks, titles, names of groups and notes stay as they are. First find those that name ${name}:</p>
    <${TextField} label="Other words, such as a nickname" value=${text} onValue=${setText} autocomplete="off" />
    <div class="actions">
      <button type="button" onClick=${look} disabled=${action.busy}>Find texts that name the person</button>
    </div>
    <${Problem} error=${action.error} />
    ${found && found.length === 0 && html`<p role="status">No text names the person.</p>`}
    ${
      found &&
      found.length > 0 &&
      html`<${Table}
        caption="Texts that name the person"
        head=${['In', 'Text', html`<span class="visually-hidden">Actions</span>`]}
      >${found.map(
        (one) => html`<tr key=${one.where}>
          <th scope="row">${one.link ? html`<a href=${one.link}>${one.about}</a>` : one.about}</th>
          <td>${one.text}</td>
          <td>
            <${DangerButton}
              small
              text="Redact"
              label=${`Remove the name from ${one.where}`}
              disabled=${action.busy}
              title=${`Remove the name from ${one.about}?`}
              act=${() => redact(one)}
            >
              The words are deleted for good; the rest of the text stays: ${one.text}
            <//>
          </td>
        </tr>`,
      )}<//>`
    }
  `;
}

export function Erasure({ name }) {
  const [asking, setAsking] = useState(false);
  const [typed, setTyped] = useState('');
  const [entry, setEntry, draft] = useDraft(`erasure/${name}`, { text: '', reason: '', waiting: false });
  const { text, reason, waiting } = entry;
  const set = (key) => (value) => setEntry({ ...entry, [key]: value });
  const [result, setResult] = useState(null);
  const action = useAction();
  const settings = useLoad((signal) => lab.settings(signal), []);
  const keeps = settings.data?.keep_recordings_of_erased;
  const erase = async () => {
    const report = await action.run(() => people.erase(name, reason, waiting));
    if (report) {
      draft.drop();
      draftOf(`person/${name}`).drop();
      setAsking(false);
      setResult(report);
    }
  };
  if (result) {
    return html`<div class="hint" role="status">
      <p><strong>The data of ${name} were erased.</strong> They now appear as ${result.pseudonym}.</p>
      <p>
        ${result.pending && html`<${Mark} kind="warn">pending<//> `}
        ${result.sessions} sessions, ${result.scores} scores. ${result.text}
      </p>
      <p><a href="#/people">Back to the people</a></p>
    </div>`;
  }
  return html`<fieldset>
    <legend>Erasure</legend>
    <p>
      ${
        keeps
          ? 'Recordings, scores and attempts stay, without a name, as set under Retention.'
          : 'Recordings, scores and attempts of this person are deleted for good.'
      }
    </p>
    <${DraftBack} draft=${draft} />
    <${Mentions} name=${name} text=${text} setText=${set('text')} />
    <div class="actions">
      <button type="button" class="danger" onClick=${() => setAsking(true)}>Erase all data …</button>
    </div>
    ${
      asking &&
      html`<${Confirm}
        title=${`Erase all data of ${name}?`}
        word="Erase for good"
        act=${erase}
        close=${() => setAsking(false)}
        busy=${action.busy || typed !== name}
        error=${action.error}
      >
        <p>This cannot be undone. Type the name to confirm.</p>
        <${TextField} label="Name" value=${typed} onValue=${setTyped} autocomplete="off" />
        <${TextField} label="Reason" value=${reason} onValue=${set('reason')} />
        <${CheckField}
          label="Also sessions that wait for a manager (they may be another person's)"
          checked=${waiting}
          onValue=${set('waiting')}
        />
      <//>`
    }
  </fieldset>`;
}

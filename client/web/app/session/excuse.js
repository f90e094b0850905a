// Excuses an attempt, for instance one in which the station failed: it does not count.
import { traineeName } from '../lib/lab.js';
import { sessions } from '../net/requests.js';
import { announce, Dialog, Problem } from '../ui/widgets.js';
import { TextField } from '../ui/fields.js';
import { DraftBack, useDraft } from '../ui/draft.js';
import { useAction } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';

function Reason({ attempt, close, done }) {
  const [reason, setReason, draft] = useDraft(`excuse/${attempt.session_id}`, '');
  const action = useAction();
  const cancel = () => {
    draft.drop();
    close();
  };
  const save = async (event) => {
    event.preventDefault();
    if (!(await action.run(() => sessions.excuse(attempt.session_id, true, reason.trim())))) return;
    draft.drop();
    announce(`Attempt ${attempt.number} of ${traineeName(attempt)} does not count.`);
    done();
  };
  return html`<${Dialog} title=${`Excuse attempt ${attempt.number} of ${traineeName(attempt)}?`} close=${close}>
    <form onSubmit=${save}>
      <p>It does not use up an allowed attempt. Recording and score stay; it can count again later.</p>
      <${TextField}
        label="Reason"
        value=${reason}
        onValue=${setReason}
        required
        maxlength="500"
        help="e.g. the device lost its force; appears in the audit"
      />
      <${Problem} error=${action.error} />
      <${DraftBack} draft=${draft} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy || !reason.trim()}>Excuse</button>
        <button type="button" onClick=${cancel}>Cancel</button>
      </div>
    </form>
  <//>`;
}

/** @param {{attempt: {session_id: string, number: number, trainee: string, excused: boolean}, done: () => void}} props */
export function Excuse({ attempt, done }) {
  const [asking, setAsking] = useState(false);
  const action = useAction();
  const count = async () => {
    if (!(await action.run(() => sessions.excuse(attempt.session_id, false, '')))) return;
    announce(`Attempt ${attempt.number} of ${traineeName(attempt)} counts again.`);
    done();
  };
  const which = `attempt ${attempt.number} of ${traineeName(attempt)}`;
  return html`
    ${
      attempt.excused
        ? html`<button
            type="button"
            class="small"
            disabled=${action.busy}
            aria-label=${`Let ${which} count again`}
            onClick=${count}
          >
            Let it count again
          </button>`
        : html`<button type="button" class="small" aria-label=${`Excuse ${which}`} onClick=${() => setAsking(true)}>
            Excuse …
          </button>`
    }
    <${Problem} error=${action.error} />
    ${
      asking &&
      html`<${Reason}
        attempt=${attempt}
        close=${() => setAsking(false)}
        done=${() => {
          setAsking(false);
          done();
        }}
      />`
    }
  `;
}

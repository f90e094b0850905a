// Sessions whose trainee was not known when they came, that came without a code, or whose exercise was not assigned to
// the trainee. Each must be given to the right person.
import { href } from '../../lib/routes.js';
import { clock, moment } from '../../lib/time.js';
import { people, sessions } from '../../net/requests.js';
import { TextField } from '../../ui/fields.js';
import { SearchField } from '../../ui/search_field.js';
import { DraftBack, useDraft } from '../../ui/draft.js';
import { useAction, useExerciseName } from '../../ui/hooks.js';
import { html, useState } from '../../ui/html.js';
import { announce, Dialog, Empty, Heading, Loaded, number, Problem, Table, usePages } from '../../ui/widgets.js';
import { Verdict, whyItWaits } from '../sessions.js';

/** Sessions of no particular person; the key is the server's name for them. */
const kGuest = { key: 'guest', text: 'No one in particular (guest)' };

/** Any person, and the guest. */
async function findPerson(text, signal) {
  const { options, more } = await people.find(text, {}, signal);
  const part = text.trim().toLowerCase();
  return { options: kGuest.text.toLowerCase().includes(part) ? [...options, kGuest] : options, more };
}

function Assign({ session, close, done }) {
  const { session_id, trainee } = session.description;
  const [entry, setEntry, draft] = useDraft(`assign/${session_id}`, { to: null, reason: '', begin: '' });
  const { to, reason, begin } = entry;
  const set = (key) => (value) => setEntry({ ...entry, [key]: value });
  const action = useAction();
  const cancel = () => {
    draft.drop();
    close();
  };
  const save = async (event) => {
    event.preventDefault();
    if (
      !(await action.run(() =>
        sessions.assign(session_id, to.key, reason.trim(), trainee, Date.parse(begin) || undefined),
      ))
    )
      return;
    draft.drop();
    announce(`The session of ${trainee} was given to ${to.key}.`);
    done();
  };
  return html`<${Dialog} title=${`Who is ${trainee}?`} close=${close}>
    <form onSubmit=${save}>
      <p>The session counts as an attempt of the person you choose: verdict, attempts and progress follow.</p>
      <${SearchField}
        label="Person"
        required
        chosen=${to}
        find=${findPerson}
        onChoose=${set('to')}
        help="type part of a name or group"
        failed="No one can be chosen: the people could not be loaded"
      />
      ${
        session.begin_unsure &&
        html`<p>The station’s clock was wrong: it says ${moment(session.description.started_unix_ms)}.</p>
          <${TextField}
            label="It began"
            type="datetime-local"
            value=${begin}
            onValue=${set('begin')}
            help="empty: the station’s time is right"
          />`
      }
      <${TextField}
        label="Reason"
        value=${reason}
        onValue=${set('reason')}
        maxlength="500"
        help="optional; appears in the audit"
      />
      <${Problem} error=${action.error} />
      <${DraftBack} draft=${draft} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy || !to}>Give the session</button>
        <button type="button" onClick=${cancel}>Cancel</button>
      </div>
    </form>
  <//>`;
}

export function UnknownTraineesPage() {
  const pages = usePages((page, signal) => sessions.unknown({ page }, signal), []);
  const nameOf = useExerciseName();
  const [asked, setAsked] = useState(null);
  const confirming = useAction();
  const confirm = async ({ description: { session_id, trainee }, not_assigned }) => {
    const why = not_assigned ? 'confirmed without an assignment' : 'confirmed without a code';
    if (!(await confirming.run(() => sessions.assign(session_id, trainee, why, trainee)))) return;
    announce(`The session belongs to ${trainee}.`);
    pages.load.reload();
  };
  return html`
    <${Heading} title="Unknown trainees" above=${html`<a href="#/sessions">Sessions</a>`} />
    <p>
      A station without the server takes any name and asks for no code. These sessions count for no one: give each to
      the right person, or confirm that its name is right. A session that was not assigned counts once you confirm it.
    </p>
    <${Problem} error=${confirming.error} />
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`<${Empty} title="No sessions are waiting">Each has a known name, and its code was given.<//>`
        : html`
            <${Table}
              caption=${pages.caption('session')}
              head=${[
                'Begun',
                'Name given',
                'Why it waits',
                'Exercise',
                'Station',
                number('Length'),
                'Verdict',
                html`<span class="visually-hidden">Actions</span>`,
              ]}
            >${pages.items.map(
              (s) => html`<tr key=${s.description.session_id}>
                <th scope="row">
                  <a href=${href(['sessions', s.description.session_id])}>${moment(s.description.started_unix_ms)}</a>
                </th>
                <td>${s.description.trainee}</td>
                <td>${whyItWaits(s)[1]}</td>
                <td>${nameOf(s.description.exercise_id)}</td>
                <td>${s.description.station}</td>
                <td class="number">${s.description.rate_hz ? clock(s.samples / s.description.rate_hz) : '–'}</td>
                <td><${Verdict} of=${s} /></td>
                <td>
                  ${
                    s.state === 'SESSION_OPEN'
                      ? 'still open'
                      : html`<div class="actions">
                          ${
                            (s.code_unchecked || s.not_assigned) &&
                            html`<button
                              type="button"
                              class="small"
                              disabled=${confirming.busy}
                              aria-label=${`Confirm the session of ${s.description.trainee}`}
                              onClick=${() => confirm(s)}
                            >
                              Confirm
                            </button>`
                          }
                          <button
                            type="button"
                            class="small"
                            aria-label=${`Give to … the session of ${s.description.trainee}`}
                            onClick=${() => setAsked(s)}
                          >
                            Give to …
                          </button>
                        </div>`
                  }
                </td>
              </tr>`,
            )}<//>
            ${pages.button}
          `}<//>
    ${
      asked &&
      html`<${Assign}
        session=${asked}
        close=${() => setAsked(null)}
        done=${() => {
          setAsked(null);
          pages.load.reload();
        }}
      />`
    }
  `;
}

// Sessions whose trainee nobody knew when they came, or whose code nobody gave, each to be given to the right person.
import { href } from '../lib/routes.js';
import { clock, moment } from '../lib/time.js';
import { people, sessions } from '../net/requests.js';
import { SelectField, TextField } from '../ui/fields.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';
import { announce, Dialog, Empty, Heading, Loaded, number, Problem, Table, usePages } from '../ui/widgets.js';
import { Verdict } from './sessions.js';

/** As the server names it: sessions of nobody in particular. */
const kGuest = 'guest';

function Assign({ session, everybody, close, done }) {
  const { session_id, trainee } = session.description;
  const [to, setTo] = useState('');
  const [reason, setReason] = useState('');
  const action = useAction();
  const save = async (event) => {
    event.preventDefault();
    if (!(await action.run(() => sessions.assign(session_id, to, reason.trim(), trainee)))) return;
    announce(`The session of ${trainee} was given to ${to}.`);
    done();
  };
  const whom = [
    ['', 'Choose …'],
    ...everybody.map((p) => [
      p.name,
      (p.full_name ? `${p.full_name} (${p.name})` : p.name) + (p.disabled ? ', disabled' : ''),
    ]),
    [kGuest, 'Nobody in particular (guest)'],
  ];
  return html`<${Dialog} title=${`Who is ${trainee}?`} close=${close}>
    <form onSubmit=${save}>
      <p>The session counts as an attempt of the person that you choose: verdict, attempts and progress follow.</p>
      <${SelectField} label="Person" required value=${to} options=${whom} onValue=${setTo} />
      <${TextField}
        label="Reason"
        value=${reason}
        onValue=${setReason}
        maxlength="500"
        help="may stay empty; stands in the audit"
      />
      <${Problem} error=${action.error} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy || !to}>Give the session</button>
        <button type="button" onClick=${close}>Cancel</button>
      </div>
    </form>
  <//>`;
}

export function UnknownTraineesPage() {
  const pages = usePages((page, signal) => sessions.unknown({ page }, signal), []);
  const everybody = useLoad((signal) => people.all(signal), []);
  const [asked, setAsked] = useState(null);
  const confirming = useAction();
  const confirm = async ({ session_id, trainee }) => {
    if (!(await confirming.run(() => sessions.assign(session_id, trainee, 'confirmed without a code', trainee))))
      return;
    announce(`The session is of ${trainee}.`);
    pages.load.reload();
  };
  return html`
    <${Heading} title="Unknown trainees" above=${html`<a href="#/sessions">Sessions</a>`} />
    <p>
      A station without the server takes any name and asks for no code. These sessions count for nobody: give each to the
      right person, or confirm that it is of whom it says.
    </p>
    <${Problem}
      error=${everybody.error}
      retry=${everybody.reload}
      title="Nobody can be chosen: the people could not be loaded"
    />
    <${Problem} error=${confirming.error} />
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`<${Empty} title="No session waits">All have a name that somebody had, and whose code was given.<//>`
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
                <td>${s.code_unchecked ? 'nobody gave the code' : 'nobody had the name'}</td>
                <td>${s.description.exercise_id}</td>
                <td>${s.description.station}</td>
                <td class="number">${s.description.rate_hz ? clock(s.samples / s.description.rate_hz) : '–'}</td>
                <td><${Verdict} passed=${s.passed} /></td>
                <td>
                  ${
                    s.state === 'SESSION_OPEN'
                      ? 'still open'
                      : html`<div class="actions">
                          ${
                            s.code_unchecked &&
                            html`<button
                              type="button"
                              class="small"
                              disabled=${confirming.busy}
                              aria-label=${`Confirm the session of ${s.description.trainee}`}
                              onClick=${() => confirm(s.description)}
                            >
                              Confirm
                            </button>`
                          }
                          <button
                            type="button"
                            class="small"
                            disabled=${!everybody.data}
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
        everybody=${everybody.data}
        close=${() => setAsked(null)}
        done=${() => {
          setAsked(null);
          pages.load.reload();
        }}
      />`
    }
  `;
}

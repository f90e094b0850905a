// Sessions whose trainee nobody knew when they came, each to be given to the right person.
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
  return html`
    <${Heading} title="Unknown trainees" above=${html`<a href="#/sessions">Sessions</a>`} />
    <p>
      A station without the server takes any name. Nobody had the names of these sessions when they came: give each to the
      right person.
    </p>
    <${Problem}
      error=${everybody.error}
      retry=${everybody.reload}
      title="Nobody can be chosen: the people could not be loaded"
    />
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`<${Empty} title="No session waits">No session has a name that nobody had when it came.<//>`
        : html`
            <${Table}
              caption=${`${pages.items.length} ${pages.items.length === 1 ? 'session' : 'sessions'}, newest first`}
              head=${[
                'Begun',
                'Name given',
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
                <td>${s.description.exercise_id}</td>
                <td>${s.description.station}</td>
                <td class="number">${s.description.rate_hz ? clock(s.samples / s.description.rate_hz) : '–'}</td>
                <td><${Verdict} passed=${s.passed} /></td>
                <td>
                  ${
                    s.state === 'SESSION_OPEN'
                      ? 'still open'
                      : html`<button
                          type="button"
                          class="small"
                          disabled=${!everybody.data}
                          aria-label=${`Give the session of ${s.description.trainee} to …`}
                          onClick=${() => setAsked(s)}
                        >
                          Give to …
                        </button>`
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

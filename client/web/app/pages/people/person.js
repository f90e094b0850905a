// One person: data, role, consent, password, code, export.
import { grantable, may } from '../../lib/roles.js';
import { href } from '../../lib/routes.js';
import { moment } from '../../lib/time.js';
import { words } from '../../lib/units.js';
import { people } from '../../net/requests.js';
import { announce, DangerButton, Heading, JsonDownload, Loaded, Mark, Problem } from '../../ui/widgets.js';
import { CheckField, SelectField, TextField } from '../../ui/fields.js';
import { DraftBack, useDraft } from '../../ui/draft.js';
import { useAction, useLoad } from '../../ui/hooks.js';
import { html, useState } from '../../ui/html.js';
import { CodeForm } from './codes.js';
import { Erasure } from './erasure.js';

function Data({ shown, me, load }) {
  const begin = { name: shown.name, full_name: shown.full_name, role: shown.role };
  const [entry, setEntry, draft] = useDraft(`person/${shown.name}`, begin, shown.revision);
  const { name, full_name, role } = entry;
  const set = (key) => (value) => setEntry({ ...entry, [key]: value });
  const action = useAction();
  const roles = grantable(me.role);
  // a person with a higher role cannot be changed
  const fixed = !roles.includes(shown.role);
  const change = async (changes, text) => {
    const person = await action.run(() => people.change({ ...shown, revision: draft.base }, changes));
    if (!person) return;
    if ('full_name' in changes) draft.drop();
    else draft.rebase(person.revision);
    load.setData(person);
    announce(text);
    // another name has another address
    if (person.name !== shown.name) location.hash = href(['people', person.name]);
  };
  const save = (event) => {
    event.preventDefault();
    change(
      {
        full_name,
        ...(role !== shown.role ? { role } : {}),
        ...(name !== shown.name ? { new_name: name } : {}),
      },
      `${name} was saved.`,
    );
  };
  return html`<form onSubmit=${save}>
    <fieldset>
      <legend>Data</legend>
      <${DraftBack} draft=${draft} />
      ${fixed && html`<p class="help">People of the role ${words(shown.role)} are changed by administrators.</p>`}
      <div class="fields">
        <${TextField} label="Account" value=${name} onValue=${set('name')} readonly=${fixed} autocomplete="off" />
        <${TextField} label="Full name" value=${full_name} onValue=${set('full_name')} readonly=${fixed} />
        <${SelectField}
          label="Role"
          value=${role}
          onValue=${set('role')}
          disabled=${fixed}
          options=${(fixed ? [shown.role] : roles).map((r) => [r, words(r)])}
        />
      </div>
      ${
        action.error?.kind === 'conflict'
          ? html`<div class="problem" role="alert">
              <p><strong>Someone else changed this person in the meantime.</strong> Your entries are still here.</p>
              <button
                type="button"
                onClick=${() => {
                  action.clear();
                  draft.discard();
                  load.reload();
                }}
              >
                Load the current version
              </button>
            </div>`
          : html`<${Problem} error=${action.error} />`
      }
      ${
        !fixed &&
        html`<div class="actions">
          <button type="submit" class="main" disabled=${action.busy}>Save</button>
          ${
            shown.disabled
              ? html`<button
                  type="button"
                  disabled=${action.busy}
                  onClick=${() => change({ disabled: false }, `${shown.name} is active again.`)}
                >
                  Enable again
                </button>`
              : html`<${DangerButton}
                  text="Disable"
                  disabled=${action.busy}
                  title=${`Disable ${shown.name}?`}
                  act=${() => change({ disabled: true }, `${shown.name} is disabled.`)}
                >
                  Every log-in and download of ${shown.name} ends now. Recordings and results stay, and the person can be enabled again.
                <//>`
          }
        </div>`
      }
    </fieldset>
  </form>`;
}

/**
 * `own`: the logged-in person's form, which asks for the old password; the person's other log-ins end with the change.
 */
export function PasswordForm({ name, own = false }) {
  const [old, setOld] = useState('');
  const [password, setPassword] = useState('');
  const [again, setAgain] = useState('');
  const action = useAction();
  const differs = again !== '' && password !== again;
  const save = async (event) => {
    event.preventDefault();
    if (password !== again || !(await action.run(() => people.setPassword(name, password, old)))) return;
    setOld('');
    setPassword('');
    setAgain('');
    announce('The password was set.');
  };
  return html`<form onSubmit=${save}>
    <fieldset>
      <legend>Password</legend>
      <input
        type="text"
        class="visually-hidden"
        autocomplete="username"
        value=${name}
        readonly
        tabindex="-1"
        aria-hidden="true"
      />
      <div class="fields">
        ${
          own &&
          html`<${TextField}
            label="Current password"
            type="password"
            autocomplete="current-password"
            value=${old}
            onValue=${setOld}
            required
          />`
        }
        <${TextField}
          label="New password"
          type="password"
          autocomplete="new-password"
          value=${password}
          onValue=${setPassword}
          required
        />
        <${TextField}
          label="Repeat password"
          type="password"
          autocomplete="new-password"
          value=${again}
          onValue=${setAgain}
          required
          path="again"
          problems=${differs ? [{ path: 'again', message: 'differs from the first' }] : []}
        />
      </div>
      <${Problem} error=${action.error} />
      <div class="actions"><button type="submit" disabled=${action.busy || differs}>Set the password</button></div>
    </fieldset>
  </form>`;
}

export function ConsentForm({ shown, load }) {
  const action = useAction();
  // show the change at once, and the stored value again if the server refuses
  const [wanted, setWanted] = useState(null);
  const set = async (consent) => {
    setWanted(consent);
    const person = await action.run(() => people.change(shown, { consent }));
    setWanted(null);
    if (person) {
      load.setData(person);
      announce(consent ? 'Consent was recorded.' : 'Consent was withdrawn.');
    }
  };
  const { consent } = shown;
  return html`<fieldset>
    <legend>Studies</legend>
    <p>
      ${
        consent?.given
          ? html`<${Mark} kind="good">consents<//>`
          : consent
            ? html`<${Mark} kind="locked">does not consent<//>`
            : html`<${Mark} kind="open">never asked<//>`
      }
      ${
        consent &&
        html` since ${moment(consent.unix_ms)}${consent.recorded_by === shown.name ? '' : `, on paper, by ${consent.recorded_by}`}
          ${consent.note && ` (${consent.note})`}`
      }
    </p>
    <p class="help">Only recordings of people who consent go into pseudonymous exports for studies.</p>
    <${CheckField}
      label="Recordings may be used in studies"
      checked=${wanted ?? !!consent?.given}
      disabled=${action.busy}
      onValue=${set}
    />
    <${Problem} error=${action.error} />
  </fieldset>`;
}

export function PersonPage({ params, person: me }) {
  const load = useLoad((signal) => people.one(params.name, signal), [params.name]);
  return html`
    <${Heading} title=${load.data?.full_name ? `${load.data.full_name} (${params.name})` : params.name} above=${html`<a href="#/people">People</a>`} />
    <${Loaded} load=${load}>${(shown) => html`
      <dl class="facts">
        <dt>Role</dt>
        <dd>${words(shown.role)}</dd>
        <dt>Id</dt>
        <dd>${shown.id}</dd>
        <dt>Since</dt>
        <dd>${moment(shown.created_unix_ms)}</dd>
        <dt>Groups</dt>
        <dd>${
          shown.groups.length
            ? shown.groups.map((id, i) => html`${i > 0 && ', '}<a href=${href(['groups', id])}>${id}</a>`)
            : 'none'
        }${shown.more_groups ? ` and ${shown.more_groups} more` : ''}</dd>
        ${
          shown.role === 'trainee' &&
          html`
            <dt>Practice</dt>
            <dd>
              <a href=${href(['progress', shown.name])}>Progress</a>, <a
                href=${href(['sessions'], { trainee: shown.name })}
              >
                sessions
              </a>
            </dd>
          `
        }
      </dl>
      ${may(me.role, 'edit people') && html`<${Data} key=${shown.revision} shown=${shown} me=${me} load=${load} />`}
      <${ConsentForm} shown=${shown} load=${load} />
      ${
        may(me.role, 'edit people') &&
        grantable(me.role).includes(shown.role) &&
        html`<${PasswordForm} name=${shown.name} own=${shown.name === me.name} /><${CodeForm} shown=${shown} load=${load} />`
      }
      ${
        may(me.role, 'export person') &&
        html`<fieldset>
          <legend>All stored data</legend>
          <${JsonDownload} file=${shown.name + '.json'} make=${() => people.everything(shown.name)}>Download as JSON<//>
        </fieldset>`
      }
      ${may(me.role, 'erase person') && shown.name !== me.name && html`<${Erasure} name=${shown.name} />`}
    `}<//>
  `;
}

// The logged-in person's own name, password, code and consent.
import { words } from '../../lib/units.js';
import { moment } from '../../lib/time.js';
import { people } from '../../net/requests.js';
import { Heading, JsonDownload, Loaded } from '../../ui/widgets.js';
import { useLoad } from '../../ui/hooks.js';
import { html } from '../../ui/html.js';
import { CodeForm } from './codes.js';
import { ConsentForm, PasswordForm } from './person.js';

function OwnConsent({ name }) {
  const load = useLoad((signal) => people.one(name, signal), [name]);
  return html`<${Loaded} load=${load}>${(shown) => html`<${ConsentForm} shown=${shown} load=${load} />`}<//>`;
}

function OwnCode({ name }) {
  const load = useLoad((signal) => people.one(name, signal), [name]);
  return html`<${Loaded} load=${load}>${(shown) => html`<${CodeForm} shown=${shown} load=${load} />`}<//>`;
}

export function AccountPage({ person }) {
  return html`
    <${Heading} title="My account" />
    <dl class="facts">
      <dt>Name</dt>
      <dd>${person.name}</dd>
      <dt>Full name</dt>
      <dd>${person.full_name || '–'}</dd>
      <dt>Role</dt>
      <dd>${words(person.role)}</dd>
      <dt>Logged in until</dt>
      <dd>${moment(person.expires_unix_ms)}</dd>
    </dl>
    ${person.role === 'trainee' && html`<${OwnConsent} name=${person.name} />`}
    <${PasswordForm} name=${person.name} own />
    <${OwnCode} name=${person.name} />
    ${
      person.role !== 'researcher' &&
      html`<fieldset>
        <legend>All data stored about me</legend>
        <${JsonDownload} file=${person.name + '.json'} make=${() => people.everything(person.name)}>Download as JSON<//>
      </fieldset>`
    }
  `;
}

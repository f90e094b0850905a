// The pages 403 (not for this role) and 404 (no such page).
import { words } from '../lib/units.js';
import { html } from '../ui/html.js';
import { Heading } from '../ui/widgets.js';

export function Forbidden({ person, path }) {
  return html`
    <${Heading} title="403: not for your role" />
    <p>
      The page <code>${path}</code> is not for the
      role <strong>${words(person.role)}</strong> of ${person.full_name || person.name}.
    </p>
    <p>If you need it, ask an administrator to change your role. <a href="#/">Go to your home page</a></p>
  `;
}

export function Lost({ path }) {
  return html`
    <${Heading} title="404: no such page" />
    <p>There is no page <code>${path}</code>; the address may be mistyped. <a href="#/">Go to your home page</a></p>
  `;
}

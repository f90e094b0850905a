// Log-in, as a page and (LoginForm) as a dialog above a page whose log-in has expired.
import { oneAtATime } from '../lib/presses.js';
import { number } from '../lib/units.js';
import { logIn } from '../net/session.js';
import { html, useEffect, useRef, useState } from '../ui/html.js';
import { useEvery } from '../ui/hooks.js';
import { TextField } from '../ui/fields.js';

function wordsOf(error, locked_s) {
  if (error.kind === 'expired')
    return 'Name or password is wrong, or this person is disabled. Check both and try again; an administrator can set a new password.';
  if (error.kind === 'busy' && locked_s > 0)
    return `Too many tries. Log-in is locked for ${number(locked_s, 4)} s more; then try again.`;
  if (error.kind === 'busy') return 'Log-in is open again: try now.';
  return error.message;
}

/** @param {{name?: string}} props with a name, asks only for the password */
export function LoginForm({ name: known }) {
  const [name, setName] = useState(known ?? '');
  const [password, setPassword] = useState('');
  const [error, setError] = useState(null);
  const [busy, setBusy] = useState(false);
  const [once] = useState(oneAtATime);
  const [locked_until_ms, setLocked] = useState(0);
  const [, setTurn] = useState(0);
  useEvery(1000, () => locked_until_ms > 0 && setTurn((t) => t + 1));
  const form = useRef(null);
  useEffect(() => {
    form.current.querySelector(known ? 'input[type=password]' : 'input').focus();
  }, []);
  const locked_s = Math.max(0, Math.ceil((locked_until_ms - Date.now()) / 1000));
  const send = async () => {
    setBusy(true);
    try {
      await logIn(name.trim(), password);
    } catch (refusal) {
      setError(refusal);
      setPassword('');
      if (refusal.kind === 'busy') setLocked(Date.now() + (refusal.retry_after_s ?? 5) * 1000);
      form.current?.querySelector('input[type=password]').focus();
    }
    setBusy(false);
  };
  const submit = (event) => {
    event.preventDefault();
    once(send);
  };
  return html`<form ref=${form} onSubmit=${submit} class="login">
    <${TextField}
      label="Name"
      value=${name}
      onValue=${setName}
      autocomplete="username"
      autocapitalize="none"
      spellcheck="false"
      required
      readonly=${!!known}
    />
    <${TextField}
      label="Password"
      type="password"
      value=${password}
      onValue=${setPassword}
      autocomplete="current-password"
      required
    />
    <div role="alert">${
      error && html`<p class="error"><span aria-hidden="true">✗</span> ${wordsOf(error, locked_s)}</p>`
    }</div>
    <div class="actions">
      <button type="submit" class="main" disabled=${busy || locked_s > 0}>${busy ? 'Logging in …' : 'Log in'}</button>
    </div>
  </form>`;
}

export function LoginPage() {
  useEffect(() => {
    document.title = 'Log in – needlelab';
  }, []);
  return html`<main id="main" class="alone">
    <h1>needlelab</h1>
    <p>Needle injection with force feedback: people, patients, courses, results.</p>
    <${LoginForm} />
  </main>`;
}

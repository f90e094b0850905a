// The console: the log-in, the page, and the frame around it.
import { match } from './lib/routes.js';
import { may } from './lib/roles.js';
import { giveUp, resume, session, stillIn } from './net/session.js';
import { html, render, useEffect, useRef, useState } from './ui/html.js';
import { useModal, useStore } from './ui/hooks.js';
import { Problem } from './ui/widgets.js';
import { Shell } from './ui/shell.js';
import { LoginForm, LoginPage } from './pages/login.js';
import { Forbidden, Lost } from './pages/forbidden.js';
import { kRoutes } from './routes.js';

/** The page's address; the focus goes to the heading of a new page. */
function useRoute() {
  const [hash, setHash] = useState(location.hash);
  useEffect(() => {
    const change = () => setHash(location.hash);
    addEventListener('hashchange', change);
    // the address may have changed since the first drawing
    change();
    return () => removeEventListener('hashchange', change);
  }, []);
  return match(kRoutes, hash);
}

function Page({ person }) {
  const { route, params, query, path } = useRoute();
  const last = useRef(path);
  useEffect(() => {
    if (last.current === path) return;
    last.current = path;
    scrollTo(0, 0);
    document.getElementById('page-title')?.focus({ preventScroll: true });
  }, [path]);
  const content = !route
    ? html`<${Lost} path=${path} />`
    : route.action && !may(person.role, route.action)
      ? html`<${Forbidden} person=${person} path=${path} />`
      : html`<${route.page} key=${path} params=${params} query=${query} person=${person} />`;
  return html`<${Shell} person=${person} section=${route?.section}>${content}<//>`;
}

/** Shown above the page, which stays as it is. */
function LoginAgain({ name }) {
  const element = useModal();
  return html`<dialog ref=${element} aria-labelledby="again-title" onCancel=${(event) => event.preventDefault()}>
    <h2 id="again-title">Log in again</h2>
    <p>Your log-in has expired. The page behind this keeps what you typed.</p>
    <${LoginForm} name=${name} />
    <p><button type="button" class="link" onClick=${giveUp}>Log in as someone else instead</button></p>
  </dialog>`;
}

function App() {
  const { state, person, error } = useStore(session);
  useEffect(() => {
    resume();
  }, []);
  useEffect(() => {
    // another page of this browser may have logged in or out meanwhile, even as another person
    const look = () =>
      document.visibilityState === 'visible' && session.get().state === 'in' && stillIn().catch(() => {});
    document.addEventListener('visibilitychange', look);
    return () => document.removeEventListener('visibilitychange', look);
  }, []);
  if (state === 'asking') return html`<main id="main"><p class="loading" role="status">Loading …</p></main>`;
  if (state === 'failed')
    return html`<main id="main" class="alone"><h1>needlelab</h1><${Problem} error=${error} retry=${resume} /></main>`;
  if (!person) return html`<${LoginPage} />`;
  return html`
    <${Page} key=${person.name} person=${person} />
    ${state === 'expired' && html`<${LoginAgain} name=${person.name} />`}
  `;
}

render(html`<${App} />`, document.getElementById('app'));

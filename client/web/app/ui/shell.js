// The frame: skip link, navigation by role, banner when the server is away, notices, keys.
import { may } from '../lib/roles.js';
import { words } from '../lib/units.js';
import { connection, tryNow } from '../net/connection.js';
import { logOut } from '../net/session.js';
import { Dialog, notice, Problem } from './widgets.js';
import { html, useEffect, useRef, useState } from './html.js';
import { useAction, useEvery, useStore } from './hooks.js';

/** [name, address, action, key after g, whether it is behind "More" where the menu is a row] */
export const kSections = [
  ['Home', '#/', null, 'h'],
  ['My results', '#/mine', 'see own', 'm'],
  ['People', '#/people', 'see people', 'p'],
  ['Groups', '#/groups', 'see people', 'g'],
  ['Profiles', '#/profiles', 'see profiles', 'f'],
  ['Courses', '#/courses', 'see courses', 'c'],
  ['Assignments', '#/assignments', 'assign', 'a'],
  ['Results', '#/results', 'see results', 'r'],
  ['Sessions', '#/sessions', 'see sessions', 's'],
  ['Live lab', '#/live', 'see live', 'l'],
  ['Exports', '#/exports', 'export', 'e', true],
  ['Retention', '#/retention', 'retention', 't', true],
  ['Audit', '#/audit', 'see audit', 'u', true],
  ['Upkeep', '#/upkeep', 'upkeep', 'k', true],
];

/** Two keys within a second and a half: g, then the section's letter. Not while a person is typing. */
function useKeys(sections, showHelp) {
  useEffect(() => {
    let armed_ms = 0;
    const press = (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.target.closest('input, textarea, select, dialog, [contenteditable]')) return;
      if (event.key === '?') showHelp();
      else if (event.key === 'g' && Date.now() - armed_ms > 1500) {
        armed_ms = Date.now();
        return;
      } else if (Date.now() - armed_ms <= 1500) {
        const section = sections.find(([, , , key]) => key === event.key);
        if (section) location.hash = section[1];
      }
      armed_ms = 0;
    };
    addEventListener('keydown', press);
    return () => removeEventListener('keydown', press);
  }, [sections]);
}

function AwayBanner() {
  const { away, next_try_ms } = useStore(connection);
  const [, setTurn] = useState(0);
  useEvery(500, () => away && setTurn((t) => t + 1));
  const seconds = Math.max(0, Math.ceil((next_try_ms - Date.now()) / 1000));
  return html`<div aria-live="assertive">${
    away &&
    html`<div class="banner">
      <p>
        <strong>! The server cannot be reached.</strong> What you typed is
        kept. <span aria-hidden="true">Next try ${seconds > 0 ? `in ${seconds} s` : 'now'}.</span>
      </p>
      <button type="button" onClick=${tryNow}>Try now</button>
    </div>`
  }</div>`;
}

function Notice() {
  const { text, at } = useStore(notice);
  const [shown, setShown] = useState(false);
  useEffect(() => {
    if (!text) return undefined;
    setShown(true);
    const timer = setTimeout(() => setShown(false), 8000);
    return () => clearTimeout(timer);
  }, [at]);
  return html`<div class="notice-place" role="status" aria-label="Notices">${
    shown &&
    html`<p class="notice">
      ${text}
      <button type="button" class="link" onClick=${() => setShown(false)}>Dismiss</button>
    </p>`
  }</div>`;
}

function Keys({ sections, close }) {
  return html`<${Dialog} title="Keyboard shortcuts" close=${close}>
    <dl class="keys">
      ${sections.map(
        ([name, , , key]) => html`<div><dt><kbd>g</kbd> then <kbd>${key}</kbd></dt><dd>${name}</dd></div>`,
      )}
      <div><dt><kbd>?</kbd></dt><dd>These shortcuts</dd></div>
      <div><dt><kbd>Ctrl</kbd> + <kbd>s</kbd></dt><dd>Save, in the editors</dd></div>
      <div>
        <dt><kbd>Alt</kbd> + <kbd>↑</kbd> <kbd>↓</kbd></dt>
        <dd>Move the exercise or layer that has the focus</dd>
      </div>
      <div>
        <dt><kbd>Space</kbd>, <kbd>←</kbd> <kbd>→</kbd></dt>
        <dd>Play or pause, and 0.1 s back or forward, in a replay that has the focus</dd>
      </div>
    </dl>
    <div class="actions"><button type="button" onClick=${close}>Close</button></div>
  <//>`;
}

/**
 * The sections in a row, the seldom used ones behind "More"; on a phone and a tablet all of them behind "Menu". What
 * opens closes by Escape, by a press elsewhere and when the page changes.
 */
function Menu({ sections, section }) {
  const [open, setOpen] = useState('');
  const element = useRef(null);
  useEffect(() => {
    if (!open) return undefined;
    const close = (event) => {
      const stays = event.type === 'pointerdown' && element.current.contains(event.target);
      if (stays || (event.type === 'keydown' && event.key !== 'Escape')) return;
      if (event.type === 'keydown') element.current.querySelector('[aria-expanded=true]')?.focus();
      setOpen('');
    };
    const kinds = ['keydown', 'pointerdown', 'hashchange'];
    for (const kind of kinds) addEventListener(kind, close);
    return () => kinds.forEach((kind) => removeEventListener(kind, close));
  }, [open]);
  const toggle = (name) => html`<button
    type="button"
    class=${`opens-${name.toLowerCase()}`}
    aria-expanded=${open === name}
    onClick=${() => setOpen(open === name ? '' : name)}
  >
    ${name}
  </button>`;
  const link = ([name, address]) => html`<li>
    <a href=${address} aria-current=${name === section ? 'page' : undefined}>${name}</a>
  </li>`;
  const more = sections.filter((one) => one[4]);
  return html`<nav aria-label="Sections" ref=${element}>
    ${toggle('Menu')}
    <ul class=${open === 'Menu' ? 'open' : ''}>
      ${sections.filter((one) => !one[4]).map(link)}
      ${more.length === 1 && link(more[0])}
      ${more.length > 1 && html`<li class="more">${toggle('More')}<ul class=${open === 'More' ? 'open' : ''}>${more.map(link)}</ul></li>`}
      <li class="account">
        <a href="#/account">My account</a>
      </li>
    </ul>
  </nav>`;
}

/** @param {{person: import('../net/session.js').Person, section?: string, children: any}} props */
export function Shell({ person, section, children }) {
  const sections = kSections.filter(([, , action]) => !action || may(person.role, action));
  const [help, setHelp] = useState(false);
  const leaving = useAction();
  useKeys(sections, () => setHelp(true));
  const skip = (event) => {
    // the address names the page, not a place in it
    event.preventDefault();
    document.getElementById('main').focus();
  };
  return html`
    <a class="skip" href="#main" onClick=${skip}>Skip to the content</a>
    <${AwayBanner} />
    <header class="top">
      <a class="brand" href="#/">needlelab</a>
      <${Menu} sections=${sections} section=${section} />
      <div class="who">
        <p><a href="#/account">${person.full_name || person.name}</a> <span class="role">${words(person.role)}</span></p>
        <button type="button" class="keys-button" onClick=${() => setHelp(true)} aria-label="Keyboard shortcuts">?</button>
        <button type="button" disabled=${leaving.busy} onClick=${() => leaving.run(logOut)}>Log out</button>
      </div>
    </header>
    <main id="main" tabindex="-1"><${Problem} error=${leaving.error} />${children}</main>
    <${Notice} />
    ${help && html`<${Keys} sections=${sections} close=${() => setHelp(false)} />`}
  `;
}

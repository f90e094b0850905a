// The parts of every page: heading, problem, table, dialog, notice, list in pages, download.
import { html, useCallback, useEffect, useId, useState } from './html.js';
import { store } from '../lib/store.js';
import { newest } from '../lib/units.js';
import { useAction, useLoad, useModal } from './hooks.js';

/** The page's heading: gets the focus when the page changes. */
export function Heading({ title, above, children }) {
  useEffect(() => {
    document.title = `${title} – needlelab`;
  }, [title]);
  return html`<header class="page-head">
    ${above && html`<p class="crumb">${above}</p>`}
    <div class="page-head-row">
      <h1 tabindex="-1" id="page-title">${title}</h1>
      ${children && html`<div class="actions">${children}</div>`}
    </div>
  </header>`;
}

/** Shows what failed and what to do. */
export function Problem({ error, retry, title }) {
  if (!error) return null;
  const away = error.kind === 'away';
  return html`<div class="problem" role="alert">
    <p><strong>${title ?? (away ? 'The server does not answer' : 'This did not work')}</strong></p>
    <p>${error.message}</p>
    ${retry && html`<button type="button" onClick=${retry}>Try again</button>`}
  </div>`;
}

/** For an empty list: shows what to do next. */
export function Empty({ title, children }) {
  return html`<div class="empty"><p><strong>${title}</strong></p>${children && html`<p>${children}</p>`}</div>`;
}

/** Shows what was loaded, that it is loading, or why it could not be loaded. */
export function Loaded({ load, children }) {
  if (load.data !== undefined) {
    return html`
      ${
        load.error &&
        html`<${Problem}
          error=${load.error}
          retry=${load.reload}
          title="Could not be reloaded; the earlier contents are below"
        />`
      }
      ${children(load.data)}
    `;
  }
  if (load.error) {
    const title = { denied: 'Not for your role', not_found: 'Not found' }[load.error.kind];
    return html`<${Problem} error=${load.error} retry=${load.reload} title=${title} />`;
  }
  return html`<p class="loading" role="status">Loading …</p>`;
}

/** A symbol, a colour and a word together, so that nothing depends on colour alone. */
export function Mark({ kind, children }) {
  const symbol = { good: '✓', bad: '✗', warn: '!', open: '○', locked: '⊘', info: 'i' }[kind];
  return html`<span class=${'mark mark-' + kind}>
    <span class="mark-symbol" aria-hidden="true">${symbol}</span>
    ${children}
  </span>`;
}

/** The head of a column of numbers, which are aligned right. */
export const number = (text) => ({ text, right: true });

const kTableRoles = { table: 'table', thead: 'rowgroup', tbody: 'rowgroup', tr: 'row', td: 'cell' };

/**
 * For a table's frame, each time it is drawn: gives each cell its column's name, which shows where rows are cards
 * (style/parts.css), and the roles of a table, which browsers drop there.
 * @param {HTMLElement|null} frame
 */
export function nameCells(frame) {
  if (!frame) return;
  const heads = [...frame.querySelectorAll('thead th')].map((th) =>
    th.querySelector('.visually-hidden') ? '' : (th.firstChild?.textContent ?? '').trim(),
  );
  for (const [tag, role] of Object.entries(kTableRoles))
    for (const one of frame.querySelectorAll(tag)) one.setAttribute('role', role);
  for (const th of frame.querySelectorAll('th'))
    th.setAttribute('role', th.scope === 'row' ? 'rowheader' : 'columnheader');
  for (const row of frame.querySelectorAll('tbody tr'))
    [...row.cells].forEach((cell, i) => {
      const is_empty = !cell.textContent.trim() && !cell.querySelector('input');
      cell.setAttribute('data-column', is_empty ? '' : (heads[i] ?? ''));
    });
}

/**
 * A table that scrolls in its own frame, reachable by keyboard.
 * @param {{caption: string, head: any[], children: any, class?: string}} props
 */
export function Table({ caption, head, children, class: name = '', hide_caption }) {
  return html`<div ref=${(frame) => nameCells(frame)} class=${'table-frame ' + name} role="region" aria-label=${caption} tabindex="0">
    <table>
      <caption class=${hide_caption ? 'visually-hidden' : ''}>${caption}</caption>
      <thead>
        <tr>${head.map((cell) =>
          cell.right ? html`<th scope="col" class="number">${cell.text}</th>` : html`<th scope="col">${cell}</th>`,
        )}</tr>
      </thead>
      <tbody>${children}</tbody>
    </table>
  </div>`;
}

/** A question or a form above the page. Escape and Cancel close it; the focus goes back to where it was. */
export function Dialog({ title, close, children, wide }) {
  const element = useModal(),
    id = useId();
  return html`<dialog
    ref=${element}
    class=${wide ? 'wide' : ''}
    aria-labelledby=${id}
    onCancel=${(event) => {
      event.preventDefault();
      close?.();
    }}
  >
    <h2 id=${id}>${title}</h2>
    ${children}
  </dialog>`;
}

/**
 * Asks before something that cannot be undone. The browser gives the focus to the first element that can have it: a
 * field that must be filled, or Cancel. So Enter destroys nothing.
 */
export function Confirm({ title, children, word, act, close, busy, error }) {
  return html`<${Dialog} title=${title} close=${close}>
    ${children}
    <${Problem} error=${error} />
    <div class="actions">
      <button type="button" onClick=${close}>Cancel</button>
      <button type="button" class="danger" disabled=${busy} onClick=${act}>${word}</button>
    </div>
  <//>`;
}

/** What a question says about a part of a form that is removed. */
export const kOfTheForm = 'It is removed from this form. The stored version does not change until the form is saved.';

/**
 * A button for something destructive: asks before it acts, and so ends in "…".
 * @param {{text: string, label?: string, small?: boolean, disabled?: boolean, title: string, word?: string, act: () => any, children: any}} props
 * `label`: for a screen reader, if `text` says too little; `word`: of the button that acts, otherwise `text`;
 * `children`: what is removed and what stays; if `act` throws, the question stays open and says why
 */
export function DangerButton({ text, label, small, disabled, title, word = text, act, children }) {
  const [asking, setAsking] = useState(false);
  const action = useAction();
  const close = () => {
    setAsking(false);
    action.clear();
  };
  const go = async () => {
    const done = await action.run(async () => {
      await act();
    });
    if (done) close();
  };
  return html`
    <button
      type="button"
      class=${small ? 'small danger' : 'danger'}
      disabled=${disabled}
      aria-label=${label}
      onClick=${() => setAsking(true)}
    >${text} …</button>
    ${
      asking &&
      html`<${Confirm} title=${title} word=${word} act=${go} close=${close} busy=${action.busy} error=${action.error}>
        <p>${children}</p>
      <//>`
    }
  `;
}

/** @type {ReturnType<typeof store<{text: string, at: number}>>} */
export const notice = store({ text: '', at: 0 });

/** Tells a screen reader, and shows a short notice at the page's foot. @param {string} text what has just been done */
export function announce(text) {
  notice.set({ text, at: Date.now() });
}

/**
 * @template T
 * @param {(page: string, signal?: AbortSignal) => Promise<{items: T[], next_page?: string}>} ask
 * @param {any[]} inputs
 */
export function usePages(ask, inputs) {
  const [more, setMore] = useState({ items: [], next_page: null, first: null });
  const load = useLoad(async (signal) => {
    const first = await ask('', signal);
    setMore({ items: [], next_page: first.next_page ?? '', first });
    return first.items ?? [];
  }, inputs);
  const action = useAction();
  const next = useCallback(
    () =>
      action.run(async () => {
        const reply = await ask(more.next_page);
        setMore({ ...more, items: [...more.items, ...(reply.items ?? [])], next_page: reply.next_page ?? '' });
      }),
    [more],
  );
  const button = html`
    <${Problem} error=${action.error} />
    ${
      more.next_page &&
      html`<p>
        <button type="button" disabled=${action.busy} onClick=${next}>${
          action.busy ? 'Loading …' : 'Show more'
        }</button>
      </p>`
    }
  `;
  const items = [...(load.data ?? []), ...more.items];
  const caption = (one, many) => newest(items.length, !!more.next_page, one, many);
  return { load, items, button, caption, first: more.first };
}

export function saveAs(file, text, type) {
  const link = Object.assign(document.createElement('a'), {
    href: URL.createObjectURL(new Blob([text], { type })),
    download: file,
  });
  link.click();
  URL.revokeObjectURL(link.href);
}

/**
 * @param {{file: string, make: () => Promise<any>, children: any}} props `make` returns what is saved as JSON
 */
export function JsonDownload({ file, make, children }) {
  const action = useAction();
  const save = async () => {
    const document_ = await action.run(make);
    if (!document_) return;
    saveAs(file, JSON.stringify(document_, null, 1), 'application/json');
  };
  return html`
    <button type="button" disabled=${action.busy} onClick=${save}>${action.busy ? 'Collecting …' : children}</button>
    <${Problem} error=${action.error} />
  `;
}

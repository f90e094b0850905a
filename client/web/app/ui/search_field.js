// A choice from a list that may be long: the server searches for the typed text and offers some matches. A combobox as
// in the ARIA practices: arrows, Enter, Escape, and the pointer.
import { html, useEffect, useId, useLayoutEffect, useRef, useState } from './html.js';
import { described, Frame, problemsAt } from './fields.js';
import { useDebounced, useLoad } from './hooks.js';
import { Problem } from './widgets.js';

const kWait_ms = 200;

/** @typedef {{key: string, text: string}} Option */

/** The list's state in words, for the eye and for a screen reader. */
function said(load, text, is_current) {
  if (!is_current || load.data === undefined) return is_current && load.error ? '' : 'Looking …';
  const { options, more } = load.data;
  if (options.length === 0) return text.trim() ? `Nothing matches “${text.trim()}”` : 'There is nothing to choose from';
  return more ? `The first ${options.length} matches: type more of the name` : `${options.length} to choose from`;
}

function Offers({ id, options, load, is_current, again, at, setAt, choose, text, failed }) {
  useLayoutEffect(() => {
    document.getElementById(`${id}-${at}`)?.scrollIntoView({ block: 'nearest' });
  }, [at, options]);
  // a press of the pointer leaves the focus in the field
  return html`<div class="offers" onMouseDown=${(event) => event.target.closest('button') ?? event.preventDefault()}>
    <ul role="listbox" id=${id} aria-label="Suggestions">${options.map(
      (o, i) => html`<li
        key=${o.key}
        role="option"
        id=${`${id}-${i}`}
        aria-selected=${i === at ? 'true' : 'false'}
        onMouseMove=${() => setAt(i)}
        onClick=${() => choose(o)}
      >
        ${o.text}
      </li>`,
    )}</ul>
    <p class="help" role="status">${said(load, text, is_current)}</p>
    <${Problem} error=${is_current && load.error} retry=${again} title=${failed} />
  </div>`;
}

/**
 * @param {{label: string, chosen: Option|null, onChoose: (option: Option|null) => void,
 *   find: (text: string, signal: AbortSignal) => Promise<{options: Option[], more: boolean}>, failed?: string, [more: string]: any}} props
 *   `find`: called with '' for the offers before anything is typed; must be the same function at each drawing
 */
export function SearchField({
  label,
  chosen,
  onChoose,
  find,
  failed,
  path = '',
  problems,
  help,
  wide,
  required,
  ...more
}) {
  const id = useId();
  const mine = problemsAt(problems, path);
  const input = useRef(null);
  const [typed, setTyped] = useState('');
  // the choice stays until another is made or the field is emptied, but a required field shows the typed text instead
  const [editing, setEditing] = useState(false);
  const [open, setOpen] = useState(false);
  const [at, setAt] = useState(0);
  const asked = useDebounced(typed, kWait_ms);
  const wanted = open && asked === typed;
  const load = useLoad((signal) => (wanted ? find(asked, signal) : Promise.resolve(undefined)), [asked, wanted]);
  const text = chosen && !editing ? chosen.text : typed;
  // matches for another text are not offered: Enter before the answer comes chooses nothing
  const is_current = wanted && !load.loading;
  const offers = is_current ? (load.data?.options ?? []) : [];
  useEffect(() => setAt(0), [load.data]);
  useEffect(() => {
    input.current.setCustomValidity(required && !chosen ? 'Choose one of the suggestions.' : '');
  }, [chosen, required]);
  const choose = (option) => {
    setTyped('');
    setEditing(false);
    setOpen(false);
    onChoose(option);
  };
  const leave = () => {
    setOpen(false);
    if (required) return;
    setEditing(false);
    setTyped('');
  };
  const show = () => {
    setOpen(true);
    if (chosen && !editing) input.current.select();
  };
  const again = () => {
    // the button disappears: the focus stays in the field
    input.current.focus();
    load.reload();
  };
  const type = (event) => {
    setTyped(event.target.value);
    setEditing(true);
    setOpen(true);
    if (chosen && (required || !event.target.value)) onChoose(null);
  };
  const press = (event) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step && !event.altKey) {
      event.preventDefault();
      if (open) setAt(Math.max(0, Math.min(at + step, offers.length - 1)));
      else setOpen(true);
    } else if (event.key === 'Enter' && open) {
      event.preventDefault();
      if (offers[at]) choose(offers[at]);
    } else if (event.key === 'Escape' && open) {
      // a dialog stays open
      event.preventDefault();
      event.stopPropagation();
      setOpen(false);
    }
  };
  return html`<${Frame} id=${id} label=${label} help=${help} problems=${mine} wide=${wide}>
    <div
      class="search-field"
      onFocusOut=${(event) => event.currentTarget.contains(event.relatedTarget) || leave()}
    >
      <input
        ref=${input}
        id=${id}
        type="text"
        role="combobox"
        autocomplete="off"
        autocapitalize="none"
        spellcheck="false"
        maxlength="64"
        aria-autocomplete="list"
        aria-expanded=${open ? 'true' : 'false'}
        aria-controls=${open ? `${id}-offers` : undefined}
        aria-activedescendant=${offers[at] ? `${id}-offers-${at}` : undefined}
        aria-describedby=${described(id, help, mine)}
        aria-invalid=${mine.length ? 'true' : undefined}
        aria-required=${required ? 'true' : undefined}
        data-path=${path || undefined}
        value=${text}
        onInput=${type}
        onKeyDown=${press}
        onClick=${show}
        ...${more}
      />
      ${
        open &&
        html`<${Offers}
          id=${`${id}-offers`}
          options=${offers}
          load=${load}
          is_current=${is_current}
          again=${again}
          at=${at}
          setAt=${setAt}
          choose=${choose}
          text=${typed}
          failed=${failed}
        />`
      }
    </div>
  <//>`;
}

// Fields of forms, each with label, unit, help and problem. `path` finds the problems that the server reports for the
// field.
import { called, placeWords, problemWords } from '../lib/plain_words.js';
import { fieldUnit, shown, typed } from '../lib/units.js';
import { kMost, kWhole } from '../profile/ranges.js';
import { html, useEffect, useId, useLayoutEffect, useRef, useState } from './html.js';
import { isWithin, valueAt, withValue } from '../lib/paths.js';
import { shownOf } from '../lib/shape.js';

/** @typedef {{path: string, message: string, severity?: string}} FieldProblem */

const at = (problems, path) => (problems ?? []).filter((p) => p.path === path);
/** Those at `path`, in the words of the form. @param {FieldProblem[]|undefined} problems @param {string} path */
export const problemsAt = (problems, path) => at(problems, path).map((p) => ({ ...p, message: problemWords(p) }));

/** A label with its field, help and problems. */
export function Frame({ id, label, unit, help, problems, wide, children }) {
  const errors = problems.filter((p) => p.severity !== 'WARNING');
  return html`<div class=${`field ${wide ? 'field-wide' : ''} ${errors.length ? 'field-bad' : ''}`}>
    <label for=${id}>${label}${unit && html` <span class="unit">(${unit})</span>`}</label>
    ${children}
    ${help && html`<p class="help" id=${id + '-help'}>${help}</p>`}
    ${
      problems.length > 0 &&
      html`<div class="field-problem" id=${id + '-problem'}>${problems.map(
        (p) => html`<p class=${p.severity === 'WARNING' ? 'warning' : 'error'}>
          <span aria-hidden="true">${p.severity === 'WARNING' ? '!' : '✗'}</span> ${p.message}
        </p>`,
      )}</div>`
    }
  </div>`;
}

export const described = (id, help, problems) =>
  [help && id + '-help', problems.length > 0 && id + '-problem'].filter(Boolean).join(' ') || undefined;

/** @param {{label: string, value: string, onValue: (text: string) => void, path?: string, problems?: FieldProblem[], [more: string]: any}} props */
export function TextField({ label, value, onValue, path = '', problems, help, wide, rows, type = 'text', ...more }) {
  const id = useId();
  called(path, label);
  const mine = problemsAt(problems, path);
  const shared = {
    id,
    value: value ?? '',
    'data-path': path || undefined,
    'aria-describedby': described(id, help, mine),
    ...more,
    'aria-invalid': mine.some((p) => p.severity !== 'WARNING') ? 'true' : undefined,
    onInput: (event) => onValue(event.target.value),
  };
  return html`<${Frame} id=${id} label=${label} help=${help} problems=${mine} wide=${wide}>${
    rows ? html`<textarea rows=${rows} ...${shared} />` : html`<input type=${type} ...${shared} />`
  }<//>`;
}

/**
 * A number in the unit that people use; the value is SI. Text that is not a number, or may mean two, stays in the field,
 * is reported here, and is not passed on. `most` and `whole`: as for `typed`.
 * @param {{label: string, value: number|undefined, onValue: (value: number|undefined) => void, factor?: number, unit?: string, most?: number, whole?: boolean, path?: string, problems?: FieldProblem[], [more: string]: any}} props
 */
export function NumberField({
  label,
  value,
  onValue,
  factor = 1,
  unit = '',
  si = unit,
  most,
  whole,
  path = '',
  problems,
  help,
  onBad,
  ...more
}) {
  const id = useId();
  const [text, setText] = useState(shown(value, factor));
  const sent = useRef(value);
  const in_factor = useRef(factor);
  // a value that changed elsewhere (undo, another revision) replaces the text, and so does another unit of the same
  // value; typing in this field does not
  useLayoutEffect(() => {
    if (Object.is(value, sent.current) && factor === in_factor.current) return;
    setText(shown(value, factor));
    sent.current = value;
    in_factor.current = factor;
  }, [value, factor]);
  const read = (of) => typed(of, factor, { most, whole });
  const { asks } = read(text) ?? {};
  const bad = read(text) === null || !!asks;
  called(path, label);
  const answer = (n) => {
    take(n);
    document.getElementById(id).focus();
  };
  const question = () =>
    html`“${text}” may be ${asks.join(' or ')}: which is it? ${asks.map(
      (n) => html`<button type="button" class="small" onClick=${() => answer(n)}>${n}${unit && ` ${unit}`}</button> `,
    )}`;
  const mine = [
    ...(bad ? [{ path, message: asks ? question() : `“${text}” is not a number; write it like 3.5` }] : []),
    ...at(problems, path).map((p) => ({ ...p, message: problemWords(p, { factor, unit, si }) })),
  ];
  useEffect(() => {
    onBad?.(path, bad);
    return () => onBad?.(path, false);
  }, [bad, path]);
  const take = (next) => {
    setText(next);
    const number = read(next);
    if (number === null || number?.asks) return;
    sent.current = number;
    onValue(number);
  };
  return html`<${Frame} id=${id} label=${label} unit=${unit} help=${help} problems=${mine}>
    <input
      id=${id}
      type="text"
      inputmode="decimal"
      autocomplete="off"
      value=${text}
      onInput=${(event) => take(event.target.value)}
      data-path=${path || undefined}
      aria-describedby=${described(id, help, mine)}
      aria-invalid=${mine.some((p) => p.severity !== 'WARNING') ? 'true' : undefined}
      ...${more}
    />
  <//>`;
}

/**
 * Shows a value that is not an option as it is.
 * @param {{label: string, value: any, options: [any, string][], onValue: (value: string) => void, [more: string]: any}} props
 */
export function SelectField({ label, value, options, onValue, path = '', problems, help, wide, ...more }) {
  const id = useId();
  called(path, label);
  const mine = problemsAt(problems, path);
  const given = value ?? '';
  const others = options.some(([key]) => key === given)
    ? []
    : [[given, given === '' ? 'not given' : `${given} (unknown)`]];
  return html`<${Frame} id=${id} label=${label} help=${help} problems=${mine} wide=${wide}>
    <select
      id=${id}
      data-path=${path || undefined}
      aria-describedby=${described(id, help, mine)}
      aria-invalid=${mine.length ? 'true' : undefined}
      onChange=${(event) => onValue(event.target.value)}
      ...${more}
    >${[...others, ...options].map(
      ([key, words]) => html`<option value=${key} selected=${key === given}>${words}</option>`,
    )}</select>
  <//>`;
}

/** @param {{label: string, checked: boolean, onValue: (checked: boolean) => void, [more: string]: any}} props */
export function CheckField({ label, checked, onValue, help, ...more }) {
  const id = useId();
  return html`<div class="field field-check">
    <input
      type="checkbox"
      id=${id}
      checked=${!!checked}
      aria-describedby=${help ? id + '-help' : undefined}
      onChange=${(event) => onValue(event.target.checked)}
      ...${more}
    />
    <label for=${id}>${label}</label>
    ${help && html`<p class="help" id=${id + '-help'}>${help}</p>`}
  </div>`;
}

/** Opens what hides a field, and goes there. @param {Element|null} field */
function goTo(field) {
  for (let box = field?.closest('details'); box; box = box.parentElement.closest('details')) box.open = true;
  field?.focus();
}

/** Opens the whole document as JSON (ui/as_json.js), for what no field can correct. */
const focusJson = () => goTo(document.querySelector('[data-path="json"]'));

/** All problems of a form in one list, each with a link to its field, or to the JSON if it has none. */
export function ProblemList({ problems }) {
  const errors = (problems ?? []).filter((p) => p.severity !== 'WARNING');
  const warnings = (problems ?? []).filter((p) => p.severity === 'WARNING');
  const go = (path) => {
    // a vector or a group leads to its first field
    const inside = path && document.querySelector(`[data-path^="${CSS.escape(path)}."]`);
    if (inside && !document.querySelector(`[data-path="${CSS.escape(path)}"]`)) return goTo(inside);
    const parts = path.split(/(?=[.[])/);
    for (let n = parts.length; n > 0; n--) {
      const field = document.querySelector(`[data-path="${CSS.escape(parts.slice(0, n).join(''))}"]`);
      if (field) return goTo(field);
    }
    return focusJson();
  };
  const list = (items) =>
    html`<ul>${items.map(
      (p) =>
        html`<li>
          <button type="button" class="link" onClick=${() => go(p.path)}>${placeWords(p.path)}</button>: ${problemWords(p)}
        </li>`,
    )}</ul>`;
  return html`<div class="problem-list" role="status" aria-label="Problems of this form">
    ${
      errors.length > 0 &&
      html`
        <p><strong>✗ ${errors.length === 1 ? 'One field has' : errors.length + ' fields have'} problems</strong></p>
        ${list(errors)}
      `
    }
    ${
      warnings.length > 0 &&
      html`
        <p><strong>! ${warnings.length === 1 ? 'One warning' : warnings.length + ' warnings'}</strong></p>
        ${list(warnings)}
      `
    }
    ${errors.length + warnings.length === 0 && html`<p>✓ No problems found</p>`}
  </div>`;
}

/** By document, each of which has one shape, so that its drawing is repeated only when it changes. */
const kShown = new WeakMap();
function shownOnce(document, shape) {
  if (!kShown.has(document)) kShown.set(document, shownOf(document, shape));
  return kShown.get(document);
}

/**
 * Replaces the fields of a value with a wrong type: says what is wrong and how to correct it.
 * @param {{f: ReturnType<typeof formOf>, path: string}} props nothing if the value is right
 */
export function Broken({ f, path }) {
  const fault = f.faultAt(path);
  if (!fault) return null;
  return html`<p class="error">
    ✗ ${placeWords(path)} ${problemWords(fault)}. <button type="button" class="link" onClick=${focusJson}>Fix it in the JSON</button>
  </p>`;
}

/**
 * @param {{doc: any, shape: import('../lib/shape.js').Shape, change: (next: any) => void, problems: FieldProblem[], onBad?: (path: string, bad: boolean) => void, readonly?: boolean}} given
 * @returns `doc` and `at`: the document as far as its values have the right types; `set` and `edit` change the
 *   document itself, only at their path; `problems`: includes those of the shape
 */
export function formOf({ doc: whole, shape, change, problems: said, onBad, readonly }) {
  const { shown: doc, faults } = shownOnce(whole, shape);
  const problems = [...faults, ...said.filter((p) => !faults.some((fault) => isWithin(p.path, fault.path)))];
  const faultAt = (path) => faults.find((fault) => fault.path === path);
  const edit = (path, next) => change((before) => withValue(before, path, next(valueAt(before, path))));
  const set = (path) => (value) => edit(path, () => value);
  const shared = (path) => ({ key: path, path, value: valueAt(doc, path), problems });
  const number = (path, label, more = {}) => {
    const name = path
      .replace(/\.[xyz]$/, '')
      .split('.')
      .at(-1);
    return html`<${NumberField}
      ...${shared(path)}
      value=${valueAt(whole, path)}
      ...${fieldUnit(name)}
      most=${kMost[path.split('.').at(-1)]}
      whole=${kWhole.includes(name)}
      label=${label}
      onValue=${set(path)}
      onBad=${onBad}
      readonly=${readonly}
      ...${more}
    />`;
  };
  const text = (path, label, more = {}) =>
    html`<${TextField}
      ...${shared(path)}
      label=${label}
      onValue=${(value) => set(path)(value === '' && !more.required ? undefined : value)}
      readonly=${readonly}
      ...${more}
    />`;
  const select = (path, label, options, more = {}) =>
    html`<${SelectField}
      ...${shared(path)}
      label=${label}
      options=${options}
      onValue=${(value) => set(path)(value === '' ? undefined : value)}
      disabled=${readonly}
      ...${more}
    />`;
  const vector = (path, label, more = {}) => {
    called(path, label);
    return html`<div class="vector" role="group" aria-label=${label}>${['x', 'y', 'z'].map((axis) =>
      number(`${path}.${axis}`, `${label} ${axis}`, more),
    )}</div>`;
  };
  const at = (path) => valueAt(doc, path);
  return { doc, change, number, text, select, vector, set, edit, at, faultAt, readonly, problems };
}

// Fields of one document by path: `f.number('layers[0].thickness_m', 'Thickness')`.
import { fieldUnit } from '../lib/units.js';
import { valueAt, withValue } from '../lib/paths.js';
import { html } from './html.js';
import { NumberField, SelectField, TextField } from './fields.js';

/**
 * @param {{doc: any, change: (next: any) => void, problems: import('./fields.js').FieldProblem[], onBad?: (path: string, bad: boolean) => void, readonly?: boolean}} given
 */
export function formOf({ doc, change, problems, onBad, readonly }) {
  const set = (path) => (value) => change((before) => withValue(before, path, value));
  const shared = (path) => ({ key: path, path, value: valueAt(doc, path), problems });
  const number = (path, label, more = {}) => {
    const name = path
      .replace(/\.[xyz]$/, '')
      .split('.')
      .at(-1);
    return html`<${NumberField}
      ...${shared(path)}
      ...${fieldUnit(name)}
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
  const vector = (path, label, more = {}) =>
    html`<div class="vector" role="group" aria-label=${label}>${['x', 'y', 'z'].map((axis) =>
      number(`${path}.${axis}`, `${label} ${axis}`, more),
    )}</div>`;
  return { doc, change, number, text, select, vector, set, at: (path) => valueAt(doc, path), readonly, problems };
}

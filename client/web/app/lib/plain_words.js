// Fields and messages in the words of the form, not of the JSON: the one place that turns what a check says into what
// a page shows.
import { parsePath } from './paths.js';
import { moment } from './time.js';
import { atStart, fieldUnit, messageIn, unitAt, words } from './units.js';

/** @type {Map<string, string>} label by the field's path without its numbers, as the forms have shown it */
const kLabels = new Map([
  ['layers', 'Layers'],
  ['targets[].tissues', 'Tissues that count'],
  ['exercises[].prerequisites', 'Must be passed first'],
  ['exercises[].aids.allowed', 'What the station may show'],
]);
const kindOf = (path) => path.replace(/\[\d+\]/g, '[]');

/** A form calls the field at `path` by this label. */
export function called(path, label) {
  if (path) kLabels.set(kindOf(path), label);
}

const small = (text) => text.replace(/^\p{Lu}(?!\p{Lu})/u, (first) => first.toLowerCase());
const kUnit = /_(?:ns?|nm?|m2?|m_s|s|rad|pa|hz|unix_ms)(?:_per_\w+)?$/;
const nameWords = (name) => small(words(name.replace(kUnit, '').replace('center', 'centre')));

/**
 * "Exercise 2, requirement 1, at least" for "exercises[1].requirements[0].min"; "The document" for ''.
 * @param {string} path
 */
export function placeWords(path) {
  const parts = [];
  let rest = [];
  for (const step of parsePath(path)) {
    if (typeof step === 'string') rest.push(step);
    else {
      parts.push(`${nameWords((rest.at(-1) ?? 'item').replace(/s$/, ''))} ${step + 1}`);
      rest = [];
    }
  }
  if (rest.length > 0) parts.push(small(kLabels.get(kindOf(path)) ?? rest.map(nameWords).join(' ')));
  return atStart(parts.join(', ')) || 'The document';
}

const kAbbreviations = new Set(['JSON', 'CSV', 'UTF', 'PIN', 'TLS', 'FEM']);
const kRaw =
  /"(?:[^"\\]|\\.)*"…?|[a-z]\w*(?:\[\d+\]|_[a-z0-9]+|\.[a-z]\w*\[)[\w.[\]]*|\b[A-Z]{3,}(?:_[A-Z]+)*\b|\d+\.\d{6,}/g;

/** The message with the form's words for fields and choices, and with short numbers; quoted text stays. */
const plain = (message) =>
  message.replace(/; known are .*$/s, '').replace(kRaw, (raw) => {
    if (raw.startsWith('"') || kAbbreviations.has(raw)) return raw;
    if (/^\d/.test(raw)) return String(Number(Number(raw).toPrecision(6)));
    return /^[A-Z]/.test(raw) ? words(raw) : small(placeWords(raw.replace(/\.$/, '')));
  });

/**
 * A problem's message under its field or in a list.
 * @param {{path: string, message: string}} problem
 * @param {{factor: number, unit: string, si: string}} [unit] of the field
 */
export const problemWords = ({ path, message }, unit = unitAt(path)) => plain(messageIn(message, unit));

/** A value of a document, for people: "3 mm", "Nerve", "centre x 0 mm, y 2 mm". @param {any} value @param {string} path */
export function valueWords(value, path) {
  const name = String(parsePath(path.replace(/\.[xyz]$/, '')).findLast((step) => typeof step === 'string') ?? '');
  if (value === undefined) return '(nothing)';
  if (Array.isArray(value)) return value.map((item) => valueWords(item, path)).join('; ') || 'none';
  if (value !== null && typeof value === 'object')
    return Object.entries(value)
      .map(([key, inner]) => `${nameWords(key)} ${valueWords(inner, `${path}.${key}`)}`)
      .join(', ');
  if (typeof value === 'string') return /^[A-Z]{3,}(?:_[A-Z]+)*$/.test(value) ? words(value) : value;
  if (typeof value !== 'number') return String(value);
  if (name.endsWith('_unix_ms')) return moment(value);
  const { factor, unit } = fieldUnit(name);
  return `${Number((value / factor).toPrecision(6))}${unit && ` ${unit}`}`;
}

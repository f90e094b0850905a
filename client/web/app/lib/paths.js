// Places in a JSON document, spelled as the server spells them: `layers[2].puncture.force_n`.
import { isObject } from './shape.js';

/**
 * @param {string} path
 * @returns {(string|number)[]}
 */
export function parsePath(path) {
  return [...path.matchAll(/([^.[\]]+)|\[(\d+)\]/g)].map((m) => (m[2] === undefined ? m[1] : Number(m[2])));
}

/**
 * @param {(string|number)[]} steps
 */
export function writePath(steps) {
  return steps.map((step, i) => (typeof step === 'number' ? `[${step}]` : (i ? '.' : '') + step)).join('');
}

/**
 * @param {any} document
 * @param {string} path
 * @returns {any} undefined if there is nothing
 */
export function valueAt(document, path) {
  return parsePath(path).reduce((at, step) => at?.[step], document);
}

/**
 * A copy with one value changed; unchanged parts are shared. Undefined removes the field or the item of a list.
 * @template T
 * @param {T} document
 * @param {string} path
 * @param {any} value
 * @returns {T}
 */
export function withValue(document, path, value) {
  const change = (at, [step, ...rest]) => {
    if (step === undefined) return value;
    // replaces a value that cannot hold the step, such as a number
    const copy = typeof step === 'number' ? (Array.isArray(at) ? [...at] : []) : isObject(at) ? { ...at } : {};
    const next = change(copy[step], rest);
    if (next !== undefined) copy[step] = next;
    else if (Array.isArray(copy)) copy.splice(step, 1);
    else delete copy[step];
    return copy;
  };
  return change(document, parsePath(path));
}

/**
 * Whether a problem at `problem` belongs to the field `path` or something inside it.
 * @param {string} problem
 * @param {string} path
 */
export function isWithin(problem, path) {
  return problem === path || problem.startsWith(path + '.') || problem.startsWith(path + '[');
}

/**
 * A copy of a list with one item at another place.
 * @template T
 * @param {T[]} items
 * @param {number} from
 * @param {number} to
 */
export function moved(items, from, to) {
  const copy = [...items];
  copy.splice(Math.max(0, Math.min(to, items.length - 1)), 0, ...copy.splice(from, 1));
  return copy;
}

/**
 * A list of names with one of them added or removed. Known names come in their order; others stay at the end.
 * @param {string[]} known
 * @param {any[]} list
 * @param {string} name
 * @param {boolean} on
 */
export function toggled(known, list, name, on) {
  const has = (other) => (other === name ? on : list.includes(other));
  return [...known.filter(has), ...list.filter((other) => !known.includes(other) && has(other))];
}

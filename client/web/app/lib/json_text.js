// A document as text that a person edits: what the text must be, and what happens to it if the form changes the
// document meanwhile. Pure.
import { found, isObject } from './shape.js';

const kDeepest = 32; // the server's limit (common/profile/strict_json.cpp)
// the relevant parts of a JSON text: a string, a number, a bracket or comma; the rest does not affect names or sizes
const kParts = /"(?:[^"\\]|\\.)*"|-?\d[\d.eE+-]*|[{}[\],]/g;

/**
 * Refuses what JSON.parse accepts but cannot reproduce: a name given twice, a number that would be rounded.
 * @param {string} text that JSON.parse accepts
 */
function checkParts(text) {
  // the objects and lists around the part: `name` of the current field, `index` of the current item
  const around = [];
  const pathOf = () =>
    around.reduce((path, { names, name, index }) => {
      if (!names) return `${path}[${index}]`;
      return name === undefined ? path : path ? `${path}.${name}` : name;
    }, '');
  const refuse = (words) => {
    const path = pathOf();
    throw new Error(`${path.length > 60 ? `${path.slice(0, 60)}…` : path}: ${words}`);
  };
  for (const [part] of text.matchAll(kParts)) {
    const inner = around.at(-1);
    if (part === '{' || part === '[') {
      if (around.length >= kDeepest) refuse(`is nested deeper than ${kDeepest}`);
      around.push(part === '{' ? { names: new Set(), name: undefined, awaits_name: true } : { index: 0 });
    } else if (part === '}' || part === ']') {
      around.pop();
    } else if (part === ',') {
      if (inner.names) inner.awaits_name = true;
      else inner.index++;
    } else if (inner?.awaits_name) {
      inner.name = JSON.parse(part);
      inner.awaits_name = false;
      if (inner.names.has(inner.name)) refuse('is given twice');
      inner.names.add(inner.name);
    } else if (part[0] !== '"') {
      const value = Number(part);
      if (!Number.isFinite(value)) refuse('is too large for a number');
      if (/^-?\d+$/.test(part) && !Number.isSafeInteger(value))
        refuse(`${part.slice(0, 60)} is too large for a whole number, at most ${Number.MAX_SAFE_INTEGER} is kept`);
    }
  }
}

/**
 * The document that a text holds.
 * @param {string} text
 * @returns {Record<string, any>} which can be written as JSON again without a change
 * @throws {Error} with words for a person: the text is not JSON, or the server would not read it
 */
export function documentOf(text) {
  let document;
  try {
    document = JSON.parse(text);
  } catch (error) {
    throw new Error(`This is not JSON yet: ${error.message}`);
  }
  if (!isObject(document)) throw new Error(`A document must be an object in braces, ${found(document)}`);
  checkParts(text);
  return document;
}

/** The text of a document. */
export const written = (document) => JSON.stringify(document, null, 2);

/**
 * A text beside the form that edits the same document.
 * @typedef {object} JsonText
 * @property {string} text the present text
 * @property {string} held the last document that the text was, `written`
 * @property {string} problem why the text is not a document; '': it is one
 * @property {boolean} apart the form changed the document while the text was not one: neither replaces the other until
 *   a person chooses
 */

/** The text of the form's document. @param {string} now `written` @returns {JsonText} */
export const textOf = (now) => ({ text: now, held: now, problem: '', apart: false });

/**
 * After the document changed, here or in the form: updates a text that is a document; keeps one that is not.
 * @param {JsonText} before
 * @param {string} now the document, `written`
 * @returns {JsonText}
 */
export function withDocument(before, now) {
  if (before.problem || before.apart) return { ...before, apart: before.apart || now !== before.held };
  return now === before.held ? before : textOf(now);
}

/**
 * After a person typed.
 * @param {JsonText} before
 * @param {string} text
 * @returns {[JsonText, Record<string, any>|undefined]} with the new document, if the text is one and the form did not
 *   change meanwhile
 */
export function withText(before, text) {
  try {
    const document = documentOf(text);
    if (before.apart) return [{ ...before, text, problem: '' }, undefined];
    return [{ text, held: written(document), problem: '', apart: false }, document];
  } catch (error) {
    return [{ ...before, text, problem: error.message }, undefined];
  }
}

/** A person chose the text instead of the form's changes meanwhile. @param {JsonText} before */
export const withOwnText = (before) => withText({ ...before, apart: false }, before.text);

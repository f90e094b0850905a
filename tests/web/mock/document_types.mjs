// The types of a document's values as proto/needlelab/profile.proto gives them: nothing of the console's own idea of them
// (client/web/app/lib/shape.js), which is tested against this.
import { readFileSync } from 'node:fs';

/**
 * Fields by message, "Limb.Plane", and values by enum; `type`: of the proto, with the whole name of a message or enum.
 * @typedef {{messages: Record<string, Record<string, {type: string, repeated: boolean}>>, enums: Record<string, string[]>}} Types
 */

/** @returns {Types} */
function read(text) {
  const messages = {},
    enums = {},
    around = []; // the messages, enums and oneofs that are open
  const scope = () =>
    around
      .filter((a) => a.kind !== 'oneof')
      .map((a) => a.name)
      .join('.');
  const part =
    /(message|enum|oneof)\s+(\w+)\s*\{|(\})|(optional\s+|repeated\s+)?([\w.]+)\s+(\w+)\s*=\s*\d+\s*(?:\[[^\]]*\])?;|(\w+)\s*=\s*\d+;/g;
  for (const [, kind, name, end, label, type, field, value] of text.replace(/\/\/.*$/gm, '').matchAll(part)) {
    if (kind) {
      around.push({ kind, name });
      if (kind === 'message') messages[scope()] = {};
      if (kind === 'enum') enums[scope()] = [];
    } else if (end) {
      around.pop();
    } else if (field) {
      messages[scope()][field] = { type, repeated: label?.startsWith('repeated') ?? false, scope: scope() };
    } else if (value && around.at(-1)?.kind === 'enum') {
      if (!value.endsWith('_UNSPECIFIED')) enums[scope()].push(value);
    }
  }
  // a name is looked for in its own message first, then outwards
  const resolved = (type, from) => {
    for (let at = from.split('.'); ; at = at.slice(0, -1)) {
      const whole = [...at, type].join('.');
      if (whole in messages || whole in enums) return whole;
      if (at.length === 0) return type;
    }
  };
  for (const fields of Object.values(messages))
    for (const field of Object.values(fields)) field.type = resolved(field.type, field.scope);
  return { messages, enums };
}

export const kTypes = read(readFileSync(new URL('../../../proto/needlelab/profile.proto', import.meta.url), 'utf8'));

function found(value) {
  if (value === null) return 'found null';
  if (Array.isArray(value)) return 'found a list';
  if (typeof value === 'boolean') return `found ${value}`;
  if (typeof value === 'object') return 'found an object';
  return typeof value === 'string' ? `found the text ${JSON.stringify(value)}` : `found the number ${value}`;
}

/**
 * The fields of a wrong type, in the words of common/profile/message_json.cpp.
 * @param {any} document
 * @param {'Profile'|'Curriculum'} message
 * @returns {{path: string, message: string, severity: 'ERROR'}[]}
 */
export function typeFaultsOf(document, message) {
  const faults = [];
  const say = (path, must, value) =>
    faults.push({ path, message: `must be ${must}${found(value)}`, severity: 'ERROR' });
  const visit = (value, type, path) => {
    if (type in kTypes.messages) {
      if (value === null || typeof value !== 'object' || Array.isArray(value)) return say(path, 'an object, ', value);
      for (const [name, field] of Object.entries(kTypes.messages[type])) {
        if (!(name in value)) continue;
        const at = path ? `${path}.${name}` : name;
        if (!field.repeated) visit(value[name], field.type, at);
        else if (!Array.isArray(value[name])) say(at, 'a list, ', value[name]);
        else value[name].forEach((item, i) => visit(item, field.type, `${at}[${i}]`));
      }
    } else if (type in kTypes.enums) {
      if (typeof value !== 'string') say(path, `one of ${kTypes.enums[type].join(', ')}; `, value);
    } else if (type === 'string') {
      if (typeof value !== 'string') say(path, 'a text, ', value);
    } else if (type === 'bool') {
      if (typeof value !== 'boolean') say(path, 'true or false, ', value);
    } else if (typeof value !== 'number') {
      say(path, 'a number, ', value);
    }
    return undefined;
  };
  visit(document, message, '');
  return faults;
}

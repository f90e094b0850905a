// What a form can show of a document while its JSON is being typed: lists that are lists, objects that are objects,
// texts that are texts. Does not change the document. Pure.
import { kModels } from '../profile/models.js';

/**
 * @typedef {'text'|'flag'|'number'|'length'|[any]|Record<string, any>} Shape 'length': a number that can be drawn; a
 *   list has its items' shape; fields of an object that are not named may hold anything
 */

/** The sections of axial models that the editor shows: in the profile, or in each layer. */
const sectionsOf = (place) =>
  Object.fromEntries(kModels.flatMap((model) => (model[place] ? [[model[place], {}]] : [])));

const kVector = { x: 'length', y: 'length', z: 'length' };
const kAnchor = { layer: 'text', offset_m: 'length' };
const kNeedle = { length_m: 'length', tip: 'text' };

/** @type {Shape} of the fields that the editor reads; the server checks all (proto/needlelab/profile.proto) */
export const kProfileShape = {
  id: 'text',
  name: 'text',
  description: 'text',
  sources: 'text',
  axial_model: 'text',
  needle: kNeedle,
  limb: {
    plane: { point_m: kVector, normal: kVector },
    sphere: { center_m: kVector, radius_m: 'length' },
    capsule: { a_m: kVector, b_m: kVector, radius_m: 'length' },
  },
  layers: [{ tissue: 'text', name: 'text', thickness_m: 'length', puncture: {}, ...sectionsOf('layer_section') }],
  tracking_wall: { stop_mode: 'text' },
  virtual_fixture: { mode: 'text' },
  orientation_limit: {},
  shaft_friction: {},
  cut_memory: {},
  bone: {},
  hub: {},
  ...sectionsOf('section'),
  volume: { structures: [{ id: 'text', kind: 'text', layer: { tissue: 'text', name: 'text' } }] },
  targets: [
    { name: 'text', center_m: kVector, radius_m: 'length', tissues: ['text'], anchor: kAnchor, structure: 'text' },
  ],
  hazards: [
    {
      name: 'text',
      kind: 'text',
      center_m: kVector,
      a_m: kVector,
      b_m: kVector,
      radius_m: 'length',
      anchor: kAnchor,
      structure: 'text',
    },
  ],
  effects: ['text'],
  directions: { plus_x: 'text', minus_x: 'text', plus_y: 'text', minus_y: 'text', plus_z: 'text', minus_z: 'text' },
};

/** @type {Shape} */
export const kCourseShape = {
  id: 'text',
  name: 'text',
  description: 'text',
  assigned_only: 'flag',
  exam: 'flag',
  results_from_unix_ms: 'number',
  exercises: [
    {
      id: 'text',
      name: 'text',
      description: 'text',
      profile_id: 'text',
      needle: kNeedle,
      aids: { allowed: ['text'] },
      plan: { frame: 'text', entry_m: kVector, direction: kVector, target_m: kVector },
      prerequisites: ['text'],
      requirements: [{ measure: 'text', min: 'number', max: 'number' }],
      attempts: 'number',
      time_limit_s: 'number',
      target_dwell_s: 'number',
      due_unix_ms: 'number',
    },
  ],
};

const kDrawn_m = 1000; // the greatest coordinate that a profile may have

export const isObject = (value) => value !== null && typeof value === 'object' && !Array.isArray(value);

/** "found the number 5", as the server says it (common/profile/message_json.cpp). */
export function found(value) {
  if (value === null) return 'found null';
  if (Array.isArray(value)) return 'found a list';
  if (typeof value === 'object') return 'found an object';
  if (typeof value === 'string') return `found the text ${JSON.stringify(value.slice(0, 60))}`;
  return typeof value === 'number' ? `found the number ${value}` : `found ${value}`;
}

/**
 * The document as a form reads it: a value of a wrong type is missing, an object or list of a wrong type is empty; items
 * of lists keep their places.
 * @param {any} document
 * @param {Shape} shape
 * @returns {{shown: any, faults: {path: string, message: string, severity: 'ERROR'}[]}} `faults`: what `shown` omits,
 *   except numbers, whose fields show them
 */
export function shownOf(document, shape) {
  const faults = [];
  const wrong = (path, must, value, instead) => {
    faults.push({ path, message: `must be ${must}, ${found(value)}`, severity: 'ERROR' });
    return instead;
  };
  const visit = (value, kind, path) => {
    if (value === undefined) return undefined;
    if (kind === 'text') return typeof value === 'string' ? value : wrong(path, 'a text', value, undefined);
    if (kind === 'flag') return typeof value === 'boolean' ? value : wrong(path, 'true or false', value, undefined);
    if (kind === 'number') return Number.isFinite(value) ? value : undefined;
    if (kind === 'length') return Number.isFinite(value) && Math.abs(value) <= kDrawn_m ? value : undefined;
    if (Array.isArray(kind))
      return Array.isArray(value)
        ? value.map((item, i) => visit(item, kind[0], `${path}[${i}]`))
        : wrong(path, 'a list', value, []);
    if (!isObject(value)) return wrong(path, 'an object', value, {});
    const copy = { ...value };
    for (const [name, of] of Object.entries(kind))
      if (name in copy) copy[name] = visit(value[name], of, path ? `${path}.${name}` : name);
    return copy;
  };
  return { shown: visit(document, shape, ''), faults };
}

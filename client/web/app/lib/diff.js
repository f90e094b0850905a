// Differences of two JSON documents, and the merge of two people's changes to one.
import { joinedOrder, namingOf, samePlaces } from './list_merge.js';
import { withValue, writePath } from './paths.js';
import { isObject } from './shape.js';

/** @typedef {{path: string, before: any, after: any}} Change undefined: absent */
/** @typedef {{path: string, base: any, mine: any, theirs: any}} Clash */

/** Whether two JSON values are the same; the order of keys does not count. */
export function same(a, b) {
  if (Object.is(a, b)) return true;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((value, i) => same(value, b[i]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => key in b && same(a[key], b[key]));
}

/**
 * Every smallest place where the two differ, in the order of the documents. Items of lists are compared by place.
 * @param {any} before
 * @param {any} after
 * @param {(string|number)[]} [at]
 * @returns {Change[]}
 */
export function changes(before, after, at = []) {
  if (same(before, after)) return [];
  const bothLists = Array.isArray(before) && Array.isArray(after);
  if (!bothLists && !(isObject(before) && isObject(after))) return [{ path: writePath(at), before, after }];
  const keys = bothLists
    ? Array.from({ length: Math.max(before.length, after.length) }, (_, i) => i)
    : [...new Set([...Object.keys(before), ...Object.keys(after)])];
  return keys.flatMap((key) => changes(before[key], after[key], [...at, key]));
}

/**
 * Merges two people's changes to one document. Takes over a change by only one of them; two different changes of one
 * value are a clash, which keeps mine for now. Follows items of lists that move by their names (list_merge.js); a list
 * whose items have no names, or that two people rearranged differently, is one value.
 * @param {any} base the common original
 * @param {any} mine
 * @param {any} theirs
 * @returns {{merged: any, taken: Change[], clashes: Clash[]}} `taken`: their changes that are in `merged`
 */
export function merge(base, mine, theirs) {
  const taken = [],
    clashes = [];
  const join = (b, m, t, at) => {
    if (same(m, t) || same(b, t)) return m;
    const path = writePath(at);
    if (same(b, m)) {
      taken.push(...changes(b, t, at));
      return t;
    }
    if ([b, m, t].every(Array.isArray)) {
      const name = namingOf([b, m, t]);
      const order = name && joinedOrder(b, m, t, name, same);
      const of = (list, key) => list.find((item) => name(item) === key);
      if (order) {
        b.forEach(
          (item, i) =>
            of(m, name(item)) !== undefined &&
            of(t, name(item)) === undefined &&
            taken.push({ path: writePath([...at, i]), before: item, after: undefined }),
        );
        return order.map((key, i) => join(of(b, key), of(m, key), of(t, key), [...at, i]));
      }
      if (!name && samePlaces([b, m, t])) return m.map((value, i) => join(b[i], value, t[i], [...at, i]));
    }
    if ([m, t].every(isObject) && (b === undefined || isObject(b))) {
      const joined = {};
      for (const key of new Set([...Object.keys(t), ...Object.keys(m)])) {
        const value = join(b?.[key], m[key], t[key], [...at, key]);
        if (value !== undefined) joined[key] = value;
      }
      return joined;
    }
    clashes.push({ path, base: b, mine: m, theirs: t });
    return m;
  };
  return { merged: join(base, mine, theirs, []), taken, clashes };
}

/**
 * The merged document with the chosen side of each clash.
 * @param {any} merged
 * @param {Clash[]} clashes
 * @param {Record<string, 'mine'|'theirs'>} choice by path
 */
export function resolved(merged, clashes, choice) {
  return clashes.reduce(
    (document, clash) => withValue(document, clash.path, choice[clash.path] === 'theirs' ? clash.theirs : clash.mine),
    merged,
  );
}

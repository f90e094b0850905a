// Two people's changes to one list: how its items are identified, and their order afterwards.

const kNameFields = ['id', 'measure', 'tissue', 'name'];

/**
 * How to identify the items of these lists when they move: texts by themselves, objects by the first field whose value
 * is unique in each list. Null: only by their place.
 * @param {any[][]} lists
 * @returns {((item: any) => string)|null}
 */
export function namingOf(lists) {
  const unique = (name) =>
    lists.every(
      (list) => list.every((item) => typeof name(item) === 'string') && new Set(list.map(name)).size === list.length,
    );
  const ways = [(item) => item, ...kNameFields.map((field) => (item) => item?.[field])];
  return ways.find(unique) ?? null;
}

/**
 * Whether no item moved, came or went: each place has the same kind of item. A list of numbers (a point in space) is
 * one value.
 */
export function samePlaces(lists) {
  const [first] = lists;
  const kind = (item) =>
    item !== null && typeof item === 'object'
      ? JSON.stringify(kNameFields.map((field) => item[field] ?? null))
      : undefined;
  return lists.every(
    (list) =>
      list.length === first.length &&
      list.every((item, i) => kind(item) !== undefined && kind(item) === kind(first[i])),
  );
}

/**
 * The names of the merged list in its order: one side's moves, and the items that either side added or removed. Null if
 * the two contradict each other: both moved items differently, or one changed an item that the other removed.
 * @param {any[]} base
 * @param {any[]} mine
 * @param {any[]} theirs
 * @param {(item: any) => string} name
 * @param {(a: any, b: any) => boolean} same
 * @returns {string[]|null}
 */
export function joinedOrder(base, mine, theirs, name, same) {
  const by = (list) => new Map(list.map((item) => [name(item), item]));
  const b = by(base),
    m = by(mine),
    t = by(theirs);
  const gone = (side, other) =>
    [...b.keys()].some((key) => !side.has(key) && other.has(key) && !same(other.get(key), b.get(key)));
  if (gone(m, t) || gone(t, m)) return null;
  const kept = (map) => [...map.keys()].filter((key) => b.has(key) && m.has(key) && t.has(key));
  const mine_moved = !same(kept(m), kept(b)),
    theirs_moved = !same(kept(t), kept(b));
  if (mine_moved && theirs_moved && !same(kept(m), kept(t))) return null;
  const [lead, other] = mine_moved ? [m, t] : [t, m];
  const order = [...lead.keys()].filter((key) => !b.has(key) || other.has(key));
  // an item that only the other side added comes after the item that it followed there
  const others = [...other.keys()];
  others.forEach((key, i) => {
    if (b.has(key) || lead.has(key)) return;
    const before = others.slice(0, i).findLast((earlier) => order.includes(earlier));
    order.splice(before === undefined ? 0 : order.indexOf(before) + 1, 0, key);
  });
  return order;
}

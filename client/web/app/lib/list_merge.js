// Two people's changes to one list: what its items are called, and in which order they stand afterwards.

const kNameFields = ['id', 'measure', 'tissue', 'name'];

/**
 * How the items of these lists are told apart wherever they stand: texts by themselves, objects by the first field that names each item of each
 * list once. Null: only by their place.
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

/** Whether nothing moved, came or went: the same kind of item at each place. Numbers of a list (a place in space) belong together. */
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
 * The names of the joined list in its order: moves of one side, what came and what went of both. Null where the two contradict each other: both
 * moved items differently, or one changed what the other took away.
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
  // what only the other added stands behind what it stood behind there
  const others = [...other.keys()];
  others.forEach((key, i) => {
    if (b.has(key) || lead.has(key)) return;
    const before = others.slice(0, i).findLast((earlier) => order.includes(earlier));
    order.splice(before === undefined ? 0 : order.indexOf(before) + 1, 0, key);
  });
  return order;
}

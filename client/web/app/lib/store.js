// A value that parts of the page observe.

/**
 * @template T
 * @param {T} initial
 */
export function store(initial) {
  let value = initial;
  const followers = new Set();
  return {
    get: () => value,
    /** @param {T} next */
    set(next) {
      if (Object.is(next, value)) return;
      value = next;
      for (const follower of [...followers]) follower(value);
    },
    /** @param {(value: T) => void} follower @returns {() => void} stops it */
    follow(follower) {
      followers.add(follower);
      return () => followers.delete(follower);
    },
  };
}

// Drafts: a form's unsaved entries, kept in this tab's storage, for each person separately, until they are saved or
// discarded, or the person logs out. Fields for passwords and codes have none.

const kPlace = 'needlelab draft ';
const placeOf = (who, name) => `${kPlace}${JSON.stringify(who)} ${name}`;

/** @returns {Storage|null} null: the browser forbids it; drafts then live only as long as their pages */
function ofTab() {
  try {
    return sessionStorage;
  } catch {
    return null;
  }
}

/**
 * @template T
 * @param {string} who the logged-in person
 * @param {string} name of the form and what it is about
 * @param {Storage|null} [storage]
 * @returns {{read: () => {value: T, base?: any}|null, write: (kept: {value: T, base?: any}) => void, drop: () => void}}
 */
export function draftAt(who, name, storage = ofTab()) {
  const place = placeOf(who, name);
  return {
    read() {
      try {
        return JSON.parse(storage?.getItem(place) ?? null);
      } catch {
        return null;
      }
    },
    write(kept) {
      try {
        storage?.setItem(place, JSON.stringify(kept));
      } catch {
        // the storage is full, and its version is older than the form's
        storage?.removeItem(place);
      }
    },
    drop: () => storage?.removeItem(place),
  };
}

/** Removes all drafts, except those of one person. @param {string} [who] @param {Storage|null} [storage] */
export function dropDrafts(who, storage = ofTab()) {
  const kept = who === undefined ? null : placeOf(who, '');
  for (const place of Array.from({ length: storage?.length ?? 0 }, (_, i) => storage.key(i)))
    if (place.startsWith(kPlace) && !(kept && place.startsWith(kept))) storage.removeItem(place);
}

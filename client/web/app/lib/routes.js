// Addresses of pages: #/profiles/shoulder-adult?revision=3. Pure: uses no window.

/** @typedef {{path: string, [key: string]: any}} Route `path` as in '/profiles/:id' */

/**
 * @param {Route[]} routes the first match is taken
 * @param {string} hash as in location.hash
 * @returns {{route: Route|null, params: Record<string, string>, query: Record<string, string>, path: string}}
 */
export function match(routes, hash) {
  const [path, search = ''] = hash.replace(/^#/, '').split('?');
  const clean = '/' + path.split('/').filter(Boolean).join('/');
  const parts = clean.split('/').slice(1);
  const query = Object.fromEntries(new URLSearchParams(search));
  for (const route of routes) {
    const wanted = route.path.split('/').slice(1);
    if (wanted.length !== parts.length) continue;
    const params = {};
    const fits = wanted.every((part, i) => {
      if (!part.startsWith(':')) return part === parts[i];
      try {
        params[part.slice(1)] = decodeURIComponent(parts[i]);
      } catch {
        return false;
      }
      return parts[i] !== '';
    });
    if (fits) return { route, params, query, path: clean };
  }
  return { route: null, params: {}, query, path: clean };
}

/**
 * @param {string[]} parts of the path, encoded here
 * @param {Record<string, any>} [query] undefined, null and '' are omitted
 */
export function href(parts, query = {}) {
  const given = Object.entries(query).filter(([, value]) => value !== undefined && value !== null && value !== '');
  const search = new URLSearchParams(given.map(([key, value]) => [key, String(value)])).toString();
  return '#/' + parts.map(encodeURIComponent).join('/') + (search ? '?' + search : '');
}

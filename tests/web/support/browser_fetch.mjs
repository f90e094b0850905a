// `fetch` as the console's modules find it in a browser, here towards a mock server.

const node_fetch = globalThis.fetch;

/**
 * Replaces `fetch`: addresses are relative to the mock's, and its cookie goes along.
 * @param {() => number} port of the mock, asked at each request
 * @returns {{sent: {path: string, method: string, headers: object}[]}} what was sent since a test emptied it
 */
export function fetchAsBrowser(port) {
  const browser = { sent: [] };
  let cookie = '';
  globalThis.fetch = async (path, options = {}) => {
    browser.sent.push({ path, method: options.method ?? 'GET', headers: options.headers ?? {} });
    const reply = await node_fetch(`http://127.0.0.1:${port()}${path}`, {
      ...options,
      headers: { ...options.headers, Cookie: cookie },
    });
    const set = reply.headers.get('set-cookie');
    if (set) cookie = set.split(';')[0];
    return reply;
  };
  return browser;
}

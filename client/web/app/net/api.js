// Requests to /api/v1: cookies, the CSRF header, expired log-ins, errors as an ApiError with a `kind`. All pages use
// these functions.
import { placeWords, problemWords } from '../lib/plain_words.js';
import { serverIsAway, serverIsThere } from './connection.js';

const kBase = '/api/v1';
const kGetTries = 3;
const kLongestWait_s = 10;

let csrf_token = '';
/** Asks the person to log in and resolves when that is done. Set by session.js. @type {() => Promise<void>} */
let renew = () => Promise.reject(new ApiError('expired', 'Log in first.'));

/**
 * Takes over the token of a log-in by another page of this browser; fails if it belongs to another person. Set by
 * session.js.
 */
let takeOver = () => Promise.reject(new ApiError('expired', 'Log in first.'));

export function setCsrfToken(token) {
  csrf_token = token;
}
export function setRenewal(ask, take_over) {
  renew = ask;
  takeOver = take_over;
}

/**
 * @typedef {object} Ask
 * @property {Record<string, any>} [query] undefined and '' are omitted
 * @property {any} [body] sent as JSON
 * @property {number} [base_revision] sent as If-Match: the revision that was changed; 0 for something new
 * @property {AbortSignal} [signal]
 * @property {boolean} [may_expire] false: a 401 is an error and does not lead to a log-in
 */

/**
 * @param {string} method
 * @param {string[]} parts of the path
 * @param {Ask} [ask]
 * @returns {Promise<any>} the reply's JSON; null if it has none
 * @throws {ApiError} ('away' when the server cannot be reached) or the signal's AbortError
 */
export async function request(method, parts, ask = {}) {
  for (let tries = 1, taken_over = false; ; tries++) {
    try {
      return await once(method, parts, ask);
    } catch (error) {
      if (error.kind === 'expired' && ask.may_expire !== false) await renew();
      else if (error.code === 'csrf' && !taken_over) {
        taken_over = true;
        await takeOver();
      } else if (error.kind === 'busy' && method === 'GET' && tries < kGetTries)
        await wait(Math.min(error.retry_after_s ?? tries, kLongestWait_s), ask.signal);
      else throw error;
    }
  }
}

async function once(method, parts, ask) {
  const headers = { Accept: 'application/json' };
  if (method !== 'GET') headers['X-CSRF-Token'] = csrf_token;
  if (ask.body !== undefined) headers['Content-Type'] = 'application/json';
  if (ask.base_revision !== undefined) headers['If-Match'] = `"${ask.base_revision}"`;
  let reply, text;
  try {
    reply = await fetch(address(parts, ask.query), {
      method,
      headers,
      credentials: 'same-origin',
      cache: 'no-store',
      signal: ask.signal,
      body: ask.body === undefined ? undefined : JSON.stringify(ask.body),
    });
    text = await reply.text();
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    serverIsAway();
    throw new ApiError(
      'away',
      'The server does not answer. What you typed is kept; try again when the connection is back.',
    );
  }
  let body = null;
  try {
    body = text ? JSON.parse(text) : null;
  } catch {
    if (reply.ok)
      throw new ApiError('failed', `The server's answer to ${method} ${address(parts)} is not JSON.`, {
        status: reply.status,
      });
  }
  if (reply.status >= 502 && !body) {
    serverIsAway();
    throw new ApiError('away', 'The server cannot be reached at the moment. What you typed is kept.');
  }
  serverIsThere();
  if (!reply.ok) throw errorOf(reply.status, body, reply.headers.get('Retry-After'));
  return body;
}

/** The address of a request; links use it for downloads. */
export function address(parts, query = {}) {
  const given = Object.entries(query).filter(([, value]) => value !== undefined && value !== null && value !== '');
  const search = new URLSearchParams(given.map(([key, value]) => [key, String(value)])).toString();
  return `${kBase}/${parts.map(encodeURIComponent).join('/')}${search ? '?' + search : ''}`;
}

function wait(seconds, signal) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(resolve, seconds * 1000);
    signal?.addEventListener('abort', () => {
      clearTimeout(timer);
      reject(signal.reason);
    });
  });
}

export const get = (parts, ask) => request('GET', parts, ask);
export const post = (parts, body, ask) => request('POST', parts, { ...ask, body });
export const put = (parts, body, ask) => request('PUT', parts, { ...ask, body });
export const patch = (parts, body, ask) => request('PATCH', parts, { ...ask, body });
export const remove = (parts, ask) => request('DELETE', parts, ask);

/**
 * All pages of a list, one after another.
 * @param {string[]} parts
 * @param {Ask} [ask]
 * @param {number} [most] greatest number of items to load
 * @returns {Promise<any[]>}
 */
export async function getAll(parts, ask = {}, most = 5000) {
  const items = [];
  for (let page = ''; ;) {
    const reply = await get(parts, { ...ask, query: { ...ask.query, page } });
    items.push(...reply.items);
    page = reply.next_page ?? '';
    if (!page || items.length >= most) return items;
  }
}

/** @typedef {'away'|'expired'|'denied'|'not_found'|'conflict'|'invalid'|'busy'|'failed'} ErrorKind */

export class ApiError extends Error {
  /**
   * @param {ErrorKind} kind
   * @param {string} message for a person
   * @param {{status?: number, field?: string, said?: string, code?: string, current_revision?: number, retry_after_s?: number}} [more]
   */
  constructor(kind, message, more = {}) {
    super(message);
    this.kind = kind;
    Object.assign(this, { status: 0, field: '', said: '', code: '', ...more });
  }
}

const kKinds = {
  400: 'invalid',
  401: 'expired',
  403: 'denied',
  404: 'not_found',
  409: 'conflict',
  413: 'invalid',
  415: 'invalid',
  422: 'invalid',
  429: 'busy',
  503: 'busy',
};

/**
 * @param {number} status
 * @param {any} body of the reply, as JSON, or null
 * @param {string|null} retry_after of the header
 */
export function errorOf(status, body, retry_after) {
  const error = body?.error ?? {};
  // the server's message begins with the field, after the name of the document
  const field = error.field ?? '',
    said = field ? (error.message ?? '').replace(/^(?:\w+: )?\S+: /, '') : '';
  const text = said
    ? `${placeWords(field)}: ${problemWords({ path: field, message: said })}`
    : (error.message ?? `The server answered with status ${status} and no message.`);
  return new ApiError(kKinds[status] ?? 'failed', text, {
    status,
    field,
    said,
    code: error.code ?? '',
    current_revision: error.current_revision ?? body?.current_revision,
    retry_after_s: Number(retry_after) || undefined,
  });
}

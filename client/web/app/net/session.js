// The log-in. When it expires, a dialog above the page asks for a new one, and nothing typed is lost.
import { dropDrafts } from '../lib/draft.js';
import { roleName } from '../lib/roles.js';
import { store } from '../lib/store.js';
import { ApiError, get, post, remove, setCsrfToken, setRenewal } from './api.js';

/** @typedef {{name: string, full_name: string, role: string, expires_unix_ms: number}} Person */
/** @typedef {'asking'|'out'|'in'|'expired'|'failed'} SessionState */

/** @type {ReturnType<typeof store<{state: SessionState, person: Person|null, error?: Error}>>} */
export const session = store({ state: 'asking', person: null });

let waiting = null;

function accept(reply) {
  setCsrfToken(reply.csrf_token);
  const person = {
    name: reply.name,
    full_name: reply.full_name ?? '',
    role: roleName(reply.role),
    expires_unix_ms: reply.expires_unix_ms,
  };
  dropDrafts(person.name);
  session.set({ state: 'in', person });
  waiting?.resolve();
  waiting = null;
}

setRenewal(() => {
  const { state, person } = session.get();
  if (!person) return Promise.reject(new ApiError('expired', 'Log in first.'));
  if (!waiting) {
    waiting = {};
    waiting.promise = new Promise((resolve, reject) => Object.assign(waiting, { resolve, reject }));
  }
  if (state !== 'expired') session.set({ state: 'expired', person });
  return waiting.promise;
}, takeOver);

/** Another page of this browser has logged in: the cookie is that page's, so the CSRF token must be, too. */
async function takeOver() {
  const before = session.get().person;
  const reply = await get(['session'], { may_expire: false });
  if (before && before.name !== reply.name) {
    giveUp();
    throw new ApiError('expired', `${reply.name} has logged in on another page of this browser: this was not sent.`);
  }
  accept(reply);
}

/** For a visible page that sends no requests by itself: any request except the session's prolongs the log-in. */
export async function stay() {
  const { state, person } = session.get();
  if (state === 'in') await get(['people', person.name]).catch(() => {});
}

/** Whether the log-in is still valid, and whose it is; asks for a new one if not. @throws {ApiError} 'away' */
export async function stillIn() {
  const reply = await get(['session']);
  if (reply.name === session.get().person?.name) accept(reply);
  else giveUp();
}

/** On start: looks for a cookie that is still valid. */
export async function resume() {
  session.set({ state: 'asking', person: null });
  try {
    accept(await get(['session'], { may_expire: false }));
  } catch (error) {
    session.set(error.kind === 'expired' ? { state: 'out', person: null } : { state: 'failed', person: null, error });
  }
}

/** @throws {ApiError} 'expired': name or password wrong; 'busy': too many tries */
export async function logIn(name, password) {
  const before = session.get().person;
  const reply = await post(['session'], { name, password }, { may_expire: false });
  // another person logs in: do not show them this page, and do not send its requests
  if (before && before.name !== reply.name) giveUp();
  accept(reply);
}

/** Gives up renewing the expired log-in: requests that wait for it fail. */
export function giveUp() {
  waiting?.reject(new ApiError('expired', 'The log-in has expired.'));
  waiting = null;
  dropDrafts();
  session.set({ state: 'out', person: null });
}

export async function logOut() {
  try {
    await remove(['session'], { may_expire: false });
  } catch (error) {
    if (error.kind !== 'expired') throw error;
  }
  setCsrfToken('');
  dropDrafts();
  session.set({ state: 'out', person: null });
}

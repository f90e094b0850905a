// Who is logged in. An expired log-in is asked for again above the page that stands there: nothing typed is lost.
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

/** Another page of this browser has logged in anew: the cookie is that one's, and so must be the CSRF token. */
async function takeOver() {
  const before = session.get().person;
  const reply = await get(['session'], { may_expire: false });
  if (before && before.name !== reply.name) {
    giveUp();
    throw new ApiError('expired', `In another page of this browser ${reply.name} has logged in: this was not sent.`);
  }
  accept(reply);
}

/** For a page that is looked at and asks for nothing by itself: any other request than for the session makes the log-in last longer. */
export async function stay() {
  const { state, person } = session.get();
  if (state === 'in') await get(['people', person.name]).catch(() => {});
}

/** Whether the log-in still holds, and whose it is; asks for a new one where it does not. @throws {ApiError} 'away' */
export async function stillIn() {
  const reply = await get(['session']);
  if (reply.name === session.get().person?.name) accept(reply);
  else giveUp();
}

/** On start: is there a cookie that still holds? */
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
  // somebody else's page is not shown to this person, nor their request sent
  if (before && before.name !== reply.name) giveUp();
  accept(reply);
}

/** The expired log-in is not renewed: requests that wait for it fail. */
export function giveUp() {
  waiting?.reject(new ApiError('expired', 'The log-in has expired.'));
  waiting = null;
  session.set({ state: 'out', person: null });
}

export async function logOut() {
  try {
    await remove(['session'], { may_expire: false });
  } catch (error) {
    if (error.kind !== 'expired') throw error;
  }
  setCsrfToken('');
  session.set({ state: 'out', person: null });
}

// Whether the server can be reached. If not, tries again with back-off until it answers; pages wait for that and load
// again.
import { backoff } from '../lib/time.js';
import { store } from '../lib/store.js';

/** @type {ReturnType<typeof store<{away: boolean, next_try_ms: number, attempt: number}>>} */
export const connection = store({ away: false, next_try_ms: 0, attempt: 0 });

let timer = 0;

/** Any answer at all means that the server is reachable. */
export function serverIsThere() {
  clearTimeout(timer);
  timer = 0;
  if (connection.get().away) connection.set({ away: false, next_try_ms: 0, attempt: 0 });
}

export function serverIsAway() {
  if (timer === 0) plan(0);
}

/** Tries at once instead of waiting. */
export function tryNow() {
  clearTimeout(timer);
  probe(connection.get().attempt);
}

function plan(attempt) {
  const wait = backoff(attempt, { first_ms: 1000 });
  connection.set({ away: true, next_try_ms: Date.now() + wait, attempt });
  timer = setTimeout(() => probe(attempt), wait);
}

async function probe(attempt) {
  try {
    const reply = await fetch('/api/v1/session', { cache: 'no-store' });
    // a proxy in front of a dead server answers 502-504
    if (reply.status >= 502) throw new Error(`status ${reply.status}`);
    serverIsThere();
  } catch {
    plan(attempt + 1);
  }
}

// The state of the lab now, over a WebSocket that reconnects by itself.
import { backoff } from '../lib/time.js';
import { stay, stillIn } from './session.js';

const kPath = '/api/v1/live';
// the server sends five messages a second: a silence of this length means that the line is dead
const kSilence_ms = 5000;
// pushed tiles do not prolong the log-in, so a visible page sends a message now and then
const kLook_ms = 4 * 60 * 1000;

/**
 * @typedef {{state: 'connecting'|'live'|'waiting', next_try_ms: number}} LineState
 * @param {(tiles: any[], live_trouble: string) => void} on_tiles `live_trouble`: why stations of other servers may be missing
 * @param {(state: LineState) => void} on_state
 * @returns {{stop: () => void, retry: () => void}}
 */
export function followLab(on_tiles, on_state) {
  let socket = null,
    retry_timer = 0,
    silence_timer = 0,
    attempt = 0,
    stopped = false,
    asks = null;

  function connect() {
    clearTimeout(retry_timer);
    on_state({ state: 'connecting', next_try_ms: 0 });
    const url = new URL(kPath, location.href);
    url.protocol = url.protocol.replace('http', 'ws');
    socket = new WebSocket(url);
    socket.onmessage = (event) => {
      let message;
      try {
        message = JSON.parse(event.data);
      } catch {
        socket.close();
        return;
      }
      attempt = 0;
      on_state({ state: 'live', next_try_ms: 0 });
      on_tiles(message.tiles ?? [], message.live_trouble ?? '');
      listen();
    };
    socket.onclose = again;
    listen();
  }
  function listen() {
    clearTimeout(silence_timer);
    silence_timer = setTimeout(() => {
      // a half-open line never reports that it is closed
      const dead = socket;
      dead.onclose = null;
      dead.close();
      again();
    }, kSilence_ms);
  }
  function again() {
    clearTimeout(silence_timer);
    if (stopped) return;
    const wait = backoff(attempt++);
    on_state({ state: 'waiting', next_try_ms: Date.now() + wait });
    // a closed line gives no reason: if the log-in has expired, ask for a new one and do not wait
    const ask = (asks ??= stillIn()
      .then(
        () => true,
        (error) => error.kind !== 'expired',
      )
      .finally(() => (asks = null)));
    retry_timer = setTimeout(async () => (await ask) && !stopped && connect(), wait);
  }
  const look_timer = setInterval(() => document.visibilityState === 'visible' && stay(), kLook_ms);
  connect();
  return {
    stop() {
      stopped = true;
      clearTimeout(retry_timer);
      clearTimeout(silence_timer);
      clearInterval(look_timer);
      socket.onclose = null;
      socket.close();
    },
    retry() {
      if (socket.readyState > 1) connect();
    },
  };
}

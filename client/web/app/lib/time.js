// Moments in the browser's locale and time zone; how long to wait before the next try.

const kMoment = { dateStyle: 'medium', timeStyle: 'short' };

/**
 * @param {number|null|undefined} unix_ms 0, null and undefined: "–"
 * @param {string} [locale]
 */
export function moment(unix_ms, locale = undefined) {
  return unix_ms ? new Intl.DateTimeFormat(locale, kMoment).format(unix_ms) : '–';
}

/** The day alone. */
export function day(unix_ms, locale = undefined) {
  return unix_ms ? new Intl.DateTimeFormat(locale, { dateStyle: 'medium' }).format(unix_ms) : '–';
}

const kDay_ms = 86_400_000;

/** "today", "yesterday", "5 days ago", by the days of the calendar. */
export function ago(unix_ms, now_ms = Date.now(), locale = undefined) {
  const midnight = (ms) => new Date(ms).setHours(0, 0, 0, 0);
  const days = Math.round((midnight(unix_ms) - midnight(now_ms)) / kDay_ms);
  return new Intl.RelativeTimeFormat(locale, { numeric: 'auto' }).format(days, 'day');
}

/** Seconds of a recording: "1:05.3"; "–" without them, as for a recording without a rate. */
export function clock(seconds) {
  if (!Number.isFinite(seconds)) return '–';
  const tenths = Math.round(Math.max(0, seconds) * 10);
  const rest = (tenths % 600) / 10;
  return `${Math.floor(tenths / 600)}:${rest < 10 ? '0' : ''}${rest.toFixed(1)}`;
}

const kLastInput_ms = Date.UTC(9999, 11, 30); // later years have more than four digits

/** For <input type="datetime-local">, in local time; '' for what that cannot show. */
export function toInput(unix_ms) {
  if (!unix_ms || !(Math.abs(unix_ms) < kLastInput_ms)) return '';
  const local = new Date(unix_ms - new Date(unix_ms).getTimezoneOffset() * 60_000);
  return local.toISOString().slice(0, 16);
}

/** @returns {number|undefined} */
export function fromInput(text) {
  const unix_ms = new Date(text).getTime();
  return text && Number.isFinite(unix_ms) ? unix_ms : undefined;
}

/**
 * Doubles from `first_ms` to `most_ms`; up to a quarter is subtracted at random, so that the browsers of a lab do not
 * try at the same moment.
 * @param {number} attempt from 0
 * @param {{first_ms?: number, most_ms?: number, random?: () => number}} [options]
 */
export function backoff(attempt, { first_ms = 500, most_ms = 15_000, random = Math.random } = {}) {
  return Math.min(most_ms, first_ms * 2 ** Math.min(attempt, 20)) * (1 - random() / 4);
}

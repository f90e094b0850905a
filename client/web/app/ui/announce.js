// Words for a screen reader, and for the eye a short notice at the page's foot.
import { store } from '../lib/store.js';

/** @type {ReturnType<typeof store<{text: string, at: number}>>} */
export const notice = store({ text: '', at: 0 });

/** @param {string} text what has just been done */
export function announce(text) {
  notice.set({ text, at: Date.now() });
}

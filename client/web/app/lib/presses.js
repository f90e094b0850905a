// Makes a press count only for what it was meant for: a dialog takes only what was pressed after it was painted, and a
// form is sent once.

/** The events that can answer a dialog, including those of Escape and of a system's "back". */
export const kPresses = ['keydown', 'pointerdown', 'mousedown', 'click', 'cancel'];
const kBegins = new Set(['keydown', 'pointerdown', 'mousedown']);

/**
 * Judges a dialog's events in their order. Times are ms of `performance.now()`, as in events: when something was
 * pressed, even if a busy page hears of it late.
 * @returns {{painted: (now_ms: number) => void, takes: (event: {type: string, timeStamp: number, repeat?: boolean}) => boolean}}
 */
export function dialogGate() {
  let painted_ms = Infinity;
  // whether the newest press, and the newest key press, was made before the dialog was there
  let is_early = false,
    is_early_key = true;
  return {
    /** The person sees the dialog from now on. */
    painted(now_ms) {
      painted_ms = now_ms;
    },
    takes({ type, timeStamp, repeat }) {
      const is_seen = timeStamp >= painted_ms;
      if (kBegins.has(type)) {
        // a key held since before keeps its state
        if (type === 'keydown' && !repeat) is_early_key = !is_seen;
        is_early = !is_seen || (type === 'keydown' && is_early_key);
        return !is_early;
      }
      // a click or a cancel belongs to the press before it
      return is_seen && !is_early;
    },
  };
}

/**
 * Does one task at a time: a call during another one is ignored, and gives undefined.
 * @returns {<T>(work: () => Promise<T>) => Promise<T|undefined>}
 */
export function oneAtATime() {
  let is_busy = false;
  return async (work) => {
    if (is_busy) return undefined;
    is_busy = true;
    try {
      return await work();
    } finally {
      is_busy = false;
    }
  };
}

/**
 * For a field of codes: a badge reader types as a US keyboard does, whatever layout this computer has, so the digit on
 * the key counts, not the sign beside it (& on a French 1).
 * @param {(text: string) => void} take the field's new text
 */
export const digitOnTheKey = (take) => (event) => {
  const digit = /^Digit(\d)$/.exec(event.code)?.[1];
  if (!digit || event.key === digit || event.shiftKey || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  const { value, selectionStart, selectionEnd } = event.target;
  take(value.slice(0, selectionStart) + digit + value.slice(selectionEnd));
};

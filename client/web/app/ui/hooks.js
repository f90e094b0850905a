// Hooks that pages share: following a store, loading, saving.
import { dialogGate, kPresses, oneAtATime } from '../lib/presses.js';
import { connection } from '../net/connection.js';
import { exercises } from '../net/requests.js';
import { session } from '../net/session.js';
import { useCallback, useEffect, useRef, useState } from './html.js';

/** @template T @param {{get: () => T, follow: (f: (v: T) => void) => () => void}} source @returns {T} */
export function useStore(source) {
  const [value, setValue] = useState(source.get());
  useEffect(() => {
    setValue(source.get());
    return source.follow(setValue);
  }, [source]);
  return value;
}

/**
 * Loads when `inputs` change, and again when the server is back.
 * @template T
 * @param {(signal: AbortSignal) => Promise<T>} load
 * @param {any[]} inputs
 * @returns {{data: T|undefined, error: Error|null, loading: boolean, reload: () => void, setData: (data: T) => void}} `data` stays while it loads again
 */
export function useLoad(load, inputs) {
  const [state, setState] = useState({ data: undefined, error: null, loading: true, inputs: null });
  const [turn, setTurn] = useState(0);
  useEffect(() => {
    const abort = new AbortController();
    setState((before) => ({ ...before, loading: true, data: before.inputs === key(inputs) ? before.data : undefined }));
    load(abort.signal).then(
      (data) => !abort.signal.aborted && setState({ data, error: null, loading: false, inputs: key(inputs) }),
      (error) => !abort.signal.aborted && setState((before) => ({ ...before, error, loading: false })),
    );
    return () => abort.abort();
  }, [...inputs, turn]);
  const reload = useCallback(() => setTurn((t) => t + 1), []);
  useEffect(() => connection.follow(({ away }) => !away && state.error?.kind === 'away' && reload()), [state.error]);
  const setData = useCallback((data) => setState((before) => ({ ...before, data, error: null })), []);
  return { data: state.data, error: state.error, loading: state.loading, reload, setData };
}
const key = (inputs) => JSON.stringify(inputs);

/** An exercise's usual name; its id until the names are loaded, and if no course has it any more. */
export function useExerciseName() {
  const load = useLoad((signal) => exercises(signal), []);
  return (id) => load.data?.find((e) => e.id === id)?.name || id;
}

/**
 * A button's action: whether it is running, and what went wrong.
 * @returns {{busy: boolean, error: Error|null, run: (work: () => Promise<any>) => Promise<any>, clear: () => void}} `run` resolves to undefined after an error, and at once while an action is running
 */
export function useAction() {
  const [state, setState] = useState({ busy: false, error: null });
  const [once] = useState(oneAtATime);
  const run = useCallback(
    (work) =>
      once(async () => {
        setState({ busy: true, error: null });
        try {
          const result = await work();
          setState({ busy: false, error: null });
          return result === undefined ? true : result;
        } catch (error) {
          setState({ busy: false, error });
          return undefined;
        }
      }),
    [],
  );
  const clear = useCallback(() => setState({ busy: false, error: null }), []);
  return { ...state, run, clear };
}

/**
 * Shows a dialog above the page while it exists. It ignores what was pressed before it was painted (`data-painted` from
 * then on); afterwards the focus returns to where it was.
 * @returns {{current: HTMLDialogElement|null}} for the dialog's `ref`
 */
export function useModal() {
  const element = useRef(null);
  useEffect(() => {
    const before = document.activeElement,
      dialog = element.current,
      gate = dialogGate();
    const guard = (event) => {
      if (gate.takes(event)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
    };
    for (const type of kPresses) dialog.addEventListener(type, guard, true);
    dialog.showModal();
    // a frame's callbacks run before it is painted, the next frame's after that
    let frame = requestAnimationFrame(() => {
      frame = requestAnimationFrame(() => {
        gate.painted(performance.now());
        dialog.dataset.painted = '';
      });
    });
    return () => {
      cancelAnimationFrame(frame);
      if (before instanceof HTMLElement && before.isConnected) before.focus();
    };
  }, []);
  return element;
}

/** The value after it has not changed for `ms`. */
export function useDebounced(value, ms) {
  const [settled, setSettled] = useState(value);
  useEffect(() => {
    const timer = setTimeout(() => setSettled(value), ms);
    return () => clearTimeout(timer);
  }, [value, ms]);
  return settled;
}

/**
 * Resolves once nothing is pressed. A server's answer shown between press and release may move the page under the
 * pointer, and the click would be lost.
 */
export async function released() {
  while (document.querySelector(':active')) await new Promise(requestAnimationFrame);
}

/**
 * An element's width in CSS pixels, as it changes.
 * @param {number} first until it is known
 * @returns {[{current: Element|null}, number]} the first for its `ref`
 */
export function useWidth(first) {
  const element = useRef(null);
  const [width, setWidth] = useState(first);
  useEffect(() => {
    const observer = new ResizeObserver(([entry]) => setWidth(Math.round(entry.contentRect.width)));
    observer.observe(element.current);
    return () => observer.disconnect();
  }, []);
  return [element, width];
}

/** Calls `act` every `ms` while the component is mounted. */
export function useEvery(ms, act) {
  const latest = useRef(act);
  latest.current = act;
  useEffect(() => {
    const timer = setInterval(() => latest.current(), ms);
    return () => clearInterval(timer);
  }, [ms]);
}

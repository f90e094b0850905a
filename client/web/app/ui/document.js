// Editing a document with revisions: draft, saving, and the conflict if another person was faster.
import { merge, resolved, same } from '../lib/diff.js';
import { isObject } from '../lib/shape.js';
import { documents } from '../net/requests.js';
import { announce } from './widgets.js';
import { draftOf } from './draft.js';
import { useAction } from './hooks.js';
import { useCallback, useEffect, useMemo, useState } from './html.js';

/**
 * @param {'profiles'|'courses'} kind
 * @param {string} id '' for a new one
 * @param {() => Promise<any>} [begin] the contents of a new one
 */
export function useDocument(kind, id, begin) {
  const store = documents(kind);
  const draft = useMemo(() => draftOf(`${kind}/${id || 'new'}`), [kind, id]);
  const [state, setState] = useState({ loading: true, error: null, base: null, doc: null, restored: false });
  const [conflict, setConflict] = useState(null);
  const [turn, setTurn] = useState(0);
  const saving = useAction();

  useEffect(() => {
    const abort = new AbortController();
    setState((before) => ({ ...before, loading: true, error: null }));
    const load = id
      ? store.one(id, undefined, abort.signal)
      : Promise.resolve(begin()).then((json) => ({ revision: 0, json }));
    load.then(
      (text) => {
        if (abort.signal.aborted) return;
        const found = draft.read(),
          kept = isObject(found?.value) ? found : null;
        // a draft keeps the revision that it was made from: a newer one leads to a conflict when the draft is saved
        const base = kept?.base ?? { revision: text.revision, json: text.json };
        setState({ loading: false, error: null, base, doc: kept?.value ?? text.json, restored: !!kept });
      },
      (error) => !abort.signal.aborted && setState((before) => ({ ...before, loading: false, error })),
    );
    return () => abort.abort();
  }, [kind, id, turn]);

  const { base, doc } = state;
  const dirty = doc !== null && !same(base.json, doc);
  const change = useCallback(
    (next) =>
      setState((before) => {
        const changed = { ...before, doc: typeof next === 'function' ? next(before.doc) : next };
        draft.write({ base: changed.base, value: changed.doc });
        return changed;
      }),
    [draft],
  );
  useEffect(() => {
    if (!dirty) return undefined;
    const ask = (event) => event.preventDefault();
    addEventListener('beforeunload', ask);
    return () => removeEventListener('beforeunload', ask);
  }, [dirty]);

  const put = async (json, revision) => {
    try {
      // the address is the opened document's, even if its JSON has another id, which the server refuses
      const saved = await store.put(id || json.id, json, revision);
      draft.drop();
      setConflict(null);
      setState({ loading: false, error: null, base: { revision: saved.revision, json }, doc: json, restored: false });
      announce(`${json.name} was saved as revision ${saved.revision}.`);
      return saved;
    } catch (error) {
      if (error.kind !== 'conflict' || !id) throw error;
      const theirs = await store.one(id);
      setConflict({ theirs, ...merge(base.json, json, theirs.json) });
      return undefined;
    }
  };
  const save = () => saving.run(() => put(doc, base.revision));
  /**
   * Resolves the conflict with one side chosen for each clash: saves the result, or puts it into the form for review.
   */
  const settle = (choice, and_save) => {
    const json = resolved(conflict.merged, conflict.clashes, choice);
    const next = { revision: conflict.theirs.revision, json: conflict.theirs.json };
    draft.write({ base: next, value: json });
    setState((before) => ({ ...before, base: next, doc: json, restored: false }));
    setConflict(null);
    return and_save ? saving.run(() => put(json, next.revision)) : undefined;
  };
  const discard = () => {
    draft.drop();
    setConflict(null);
    setTurn((t) => t + 1);
  };
  return {
    ...state,
    dirty,
    change,
    save,
    saving,
    conflict,
    settle,
    discard,
    closeConflict: () => setConflict(null),
    reload: () => setTurn((t) => t + 1),
    /** counts how often the document was loaded; a new number drops what was typed before */
    turn,
  };
}

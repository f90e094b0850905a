// Drafts of forms (lib/draft.js), and the line that says that one is back.
import { same } from '../lib/diff.js';
import { draftAt } from '../lib/draft.js';
import { session } from '../net/session.js';
import { html, useState } from './html.js';
import { DangerButton } from './widgets.js';

/** The logged-in person's draft. @param {string} name */
export const draftOf = (name) => draftAt(session.get().person?.name ?? '', name);

/**
 * What a person types into a form, as `useState`, and kept as a draft while it differs from `begin`.
 * @template T
 * @param {string} name of the form and what it is about, the same while the form is shown
 * @param {T} begin JSON
 * @param {any} [base] the revision that `begin` is of: a draft keeps its own, and a newer one leads to a conflict when it is saved
 * @returns {[T, (next: T | ((before: T) => T)) => void, {back: boolean, base: any, rebase: (base: any) => void, drop: () => void, discard: () => void}]} `back`: it was restored; `drop`: it is saved
 */
export function useDraft(name, begin, base) {
  const [draft] = useState(() => draftOf(name));
  const [state, setState] = useState(() => {
    const kept = draft.read();
    return kept && !same(kept.value, begin) ? { ...kept, back: true } : { value: begin, base, back: false };
  });
  const change = (what) =>
    setState((before) => {
      const { value, base: of, back } = { ...before, ...what(before) };
      if (same(value, begin)) draft.drop();
      else draft.write({ value, base: of });
      return { value, base: of, back };
    });
  const drop = () => {
    draft.drop();
    setState((before) => ({ ...before, back: false }));
  };
  const discard = () => {
    draft.drop();
    setState({ value: begin, base, back: false });
  };
  const set = (next) => change(({ value }) => ({ value: typeof next === 'function' ? next(value) : next }));
  const rebase = (next) => change(() => ({ base: next }));
  return [state.value, set, { back: state.back, base: state.base, rebase, drop, discard }];
}

/**
 * In a form: says that its draft is back. In a dialog not above the fields, the first of which gets the focus.
 * @param {{draft: {back: boolean, discard?: () => void}}} props
 */
export function DraftBack({ draft: { back, discard } }) {
  if (!back) return null;
  return html`<div class="hint draft-back" role="status">
    <p>Your draft is back.</p>
    ${
      discard &&
      html`<${DangerButton} small text="Discard" label="Discard the draft" title="Discard the draft?" act=${discard}>
        What you typed here and did not save is lost.
      <//>`
    }
  </div>`;
}

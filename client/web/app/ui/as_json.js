// The whole document as text: for values without a field, and for what no field can correct.
import { textOf, withDocument, withOwnText, withText, written } from '../lib/json_text.js';
import { TextField } from './fields.js';
import { html, useLayoutEffect, useState } from './html.js';

/**
 * @param {{whole: any, change: (next: any) => void, onBad: (path: string, bad: boolean) => void, turn: number, readonly?: boolean}} props
 *   `whole`: the document itself; `onBad` is called while the text holds what the document does not; a new `turn`
 *   drops what was typed
 */
export function AsJson({ whole, change, onBad, turn, readonly }) {
  const now = written(whole);
  const [state, setState] = useState(() => textOf(now));
  const takeForms = () => setState(textOf(now));
  // before the next key, which may save
  useLayoutEffect(() => setState((before) => withDocument(before, now)), [now]);
  useLayoutEffect(takeForms, [turn]);
  const { text, problem, apart } = state;
  const bad = problem !== '' || apart;
  useLayoutEffect(() => {
    onBad('json', bad);
    return () => onBad('json', false);
  }, [bad]);
  const take = ([next, document]) => {
    setState(next);
    if (document) change(document);
  };
  const meanwhile = 'The form has changed meanwhile, and this text lacks those changes: choose one of the two';
  const problems = [problem, apart && meanwhile].filter(Boolean).map((message) => ({ path: 'json', message }));
  return html`<details>
    <summary>The whole document as JSON</summary>
    <${TextField}
      label="JSON"
      rows="18"
      value=${text}
      onValue=${(typed) => take(withText(state, typed))}
      spellcheck="false"
      readonly=${readonly}
      wide
      path="json"
      problems=${problems}
      class="mono"
    />
    ${
      bad &&
      html`<div class="actions">
        <button type="button" onClick=${takeForms}>Take the form's</button>
        ${
          apart &&
          html`<button type="button" disabled=${problem !== ''} onClick=${() => take(withOwnText(state))}>
            Take this text
          </button>`
        }
      </div>`
    }
  </details>`;
}

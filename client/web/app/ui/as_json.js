// The whole document as text: for values without a field, and for what no field can mend.
import { documentOf } from '../lib/shape.js';
import { TextField } from './fields.js';
import { html, useEffect, useRef, useState } from './html.js';

const written = (document) => JSON.stringify(document, null, 2);

/** @param {{whole: any, change: (next: any) => void, readonly?: boolean}} props `whole`: the document itself */
export function AsJson({ whole, change, readonly }) {
  const now = written(whole);
  const [text, setText] = useState(now);
  const [problem, setProblem] = useState('');
  // the document that the text holds: what is typed here stays as it was typed
  const held = useRef(now);
  useEffect(() => {
    if (problem || now === held.current) return;
    held.current = now;
    setText(now);
  }, [now]);
  const take = (next) => {
    setText(next);
    try {
      const document = documentOf(next);
      held.current = written(document);
      change(document);
      setProblem('');
    } catch (error) {
      setProblem(error.message);
    }
  };
  return html`<details>
    <summary>The whole as JSON</summary>
    <${TextField}
      label="JSON"
      rows="18"
      value=${text}
      onValue=${take}
      spellcheck="false"
      readonly=${readonly}
      wide
      path="json"
      problems=${problem ? [{ path: 'json', message: problem }] : []}
      class="mono"
    />
  </details>`;
}

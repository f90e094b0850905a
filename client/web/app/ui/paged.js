// A list that comes in pages: the first at once, the next when asked for.
import { html, useCallback, useState } from './html.js';
import { useAction, useLoad } from './hooks.js';
import { Problem } from './parts.js';

/**
 * @template T
 * @param {(page: string, signal?: AbortSignal) => Promise<{items: T[], next_page?: string}>} ask
 * @param {any[]} inputs
 */
export function usePages(ask, inputs) {
  const [more, setMore] = useState({ items: [], next_page: null });
  const load = useLoad(async (signal) => {
    const first = await ask('', signal);
    setMore({ items: [], next_page: first.next_page ?? '' });
    return first.items ?? [];
  }, inputs);
  const action = useAction();
  const next = useCallback(
    () =>
      action.run(async () => {
        const reply = await ask(more.next_page);
        setMore({ items: [...more.items, ...(reply.items ?? [])], next_page: reply.next_page ?? '' });
      }),
    [more],
  );
  const button = html`
    <${Problem} error=${action.error} />
    ${
      more.next_page &&
      html`<p>
        <button type="button" disabled=${action.busy} onClick=${next}>${
          action.busy ? 'Loading …' : 'Show more'
        }</button>
      </p>`
    }
  `;
  return { load, items: [...(load.data ?? []), ...more.items], button };
}

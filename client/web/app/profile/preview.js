// Force over depth as the engine will render it; the server computes it while the user types.
import { kCurves, structureColors, tissueColor } from '../lib/tissue.js';
import { atStart, number, quantity, words } from '../lib/units.js';
import { previewProfile } from '../net/requests.js';
import { Chart } from '../ui/chart.js';
import { released, useDebounced } from '../ui/hooks.js';
import { html, useEffect, useMemo, useRef, useState } from '../ui/html.js';

/**
 * The newest successful preview, as far as `to_depth_m` if that is given; `stale` if the document has changed since, or
 * cannot be rendered.
 * @returns {{preview: any, stale: boolean, error: Error|null}}
 */
export function usePreview(doc, to_depth_m) {
  const settled = useDebounced(doc, 350);
  const [state, setState] = useState({ preview: null, of: null, error: null });
  useEffect(() => {
    if (!settled) return undefined;
    const abort = new AbortController();
    const show = (state) => released().then(() => !abort.signal.aborted && setState(state));
    previewProfile(settled, abort.signal, to_depth_m ? { to_depth_m } : {}).then(
      (preview) => show({ preview, of: settled, error: null }),
      (error) => show((before) => ({ ...before, error })),
    );
    return () => abort.abort();
  }, [settled, to_depth_m]);
  return { preview: state.preview, stale: state.of !== doc, error: state.error };
}

// the section alone: the hand hardly moves
const kSectionAlone = { points: 2, to_depth_m: 0.001 };

/**
 * A body's section, redrawn while a slider moves: one request at a time, the last one of the newest document.
 * @returns {{section: any, error: Error|null}} `section`: the last one that could be drawn
 */
export function useSection(doc) {
  const [state, setState] = useState({ section: null, error: null });
  const latest = useRef(null),
    busy = useRef(false);
  latest.current = doc?.volume ? doc : null;
  const ask = async () => {
    if (busy.current || !latest.current) return;
    busy.current = true;
    const asked = latest.current;
    await previewProfile(asked, undefined, kSectionAlone).then(
      (preview) => setState({ section: preview.section ?? null, error: null }),
      (error) => setState((before) => ({ ...before, error })),
    );
    busy.current = false;
    if (latest.current !== asked) ask();
  };
  useEffect(() => void ask(), [doc?.volume, doc?.targets, doc?.needle]);
  return state;
}

/** @param {{preview: any, stale: boolean, error: Error|null, title?: string, height?: number, limits?: import('../lib/axis.js').Limit[], total_only?: boolean}} props */
export function ForceOverDepth({ preview, stale, error, title, height = 280, limits, total_only }) {
  const shown = useMemo(() => {
    if (!preview?.depth_m?.length) return null; // a volume may have a picture and no forces
    const mm = preview.depth_m.map((d) => d * 1000);
    const parts = (total_only ? [] : (preview.by_effect ?? [])).filter((c) =>
      c.force_n.some((f) => Math.abs(f) > 1e-6),
    );
    const series = [
      { label: 'Total (N)', values: preview.total_n, ...kCurves[0], width: 3 },
      ...parts.map((c, i) => ({
        label: `${words(c.effect)} (N)`,
        values: c.force_n,
        ...kCurves[1 + (i % (kCurves.length - 1))],
        width: 1.5,
      })),
    ];
    const { structures } = preview.section ?? { structures: [] },
      colors = structureColors(structures);
    const bands = (preview.layers ?? []).map((l) => ({
      from: l.from_m * 1000,
      to: l.to_m * 1000,
      label: atStart(l.name),
      color: preview.section ? colors[structures.findIndex((s) => s.name === l.name)] : tissueColor(l.tissue),
    }));
    const peak = preview.total_n.reduce((best, f, i) => (f > preview.total_n[best] ? i : best), 0);
    const greatest = `${quantity(preview.total_n[peak], 'N')} at ${quantity(preview.depth_m[peak], 'm')}`;
    const summary = `Force against the needle over ${number(mm.at(-1), 3)} mm of depth: greatest ${greatest}.`;
    return { x: { label: 'Depth under the skin (mm)', values: mm }, series, bands, summary };
  }, [preview]);
  if (!shown)
    return html`<p class="help" role="status">${
      !error
        ? preview && !stale
          ? 'The server draws this profile, but gives no force for it.'
          : 'Asking the engine …'
        : error.kind === 'invalid'
          ? 'The force can be drawn once the problems below are fixed.'
          : error.message
    }</p>`;
  return html`
    <${Chart}
      title=${title ?? 'Force over depth, as the engine renders it'}
      summary=${shown.summary}
      x=${shown.x}
      series=${shown.series}
      bands=${shown.bands}
      y_label="Force (N)"
      quantity="force"
      height=${height}
      limits=${limits}
    />
    <p class="help" role="status">${
      total_only && !stale
        ? ''
        : stale && error
          ? '! This is the last version that could be rendered.'
          : stale
            ? 'Rendering …'
            : shown.summary
    }</p>
  `;
}

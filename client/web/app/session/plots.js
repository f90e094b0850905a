// Force, depth and speed over time, with the layers behind them. Dragging zooms in and loads finer samples.
import { limitsOf } from '../lib/axis.js';
import { forceOf, layerSpans } from '../lib/recording.js';
import { kCurves, layerColors, layerNames, tissueColor } from '../lib/tissue.js';
import { atStart, number, quantity as said } from '../lib/units.js';
import { Chart } from '../ui/chart.js';
import { html, useMemo } from '../ui/html.js';

const range = (values) =>
  values.reduce(
    ([low, high], v) => (Number.isFinite(v) ? [Math.min(low, v), Math.max(high, v)] : [low, high]),
    [Infinity, -Infinity],
  );

/** @param {{columns: any, profile: any, requirements: any[]|undefined, marks: any[], at: number, seek: (s: number) => void, window: {from_s: number, to_s: number}|null, zoom: (w: any) => void, busy: boolean}} props */
export function Plots({ columns, profile, requirements, marks, at, seek, window, zoom, busy }) {
  const drawn = useMemo(() => {
    const t = columns.t_s ?? [];
    const names = layerNames(profile),
      colors = layerColors(profile);
    const bands = layerSpans(columns).map((s) => ({
      from: s.from,
      to: s.to,
      label: atStart(names[s.layer] ?? `layer ${s.layer + 1}`),
      color: colors[s.layer] ?? tissueColor(),
    }));
    const plot = (title, unit, quantity, values, curve) => {
      const [low, high] = range(values);
      const summary = Number.isFinite(high)
        ? `${title}: from ${number(low, 3)} to ${number(high, 3)} ${unit} between ${number(t[0] ?? 0, 3)} and ${number(t.at(-1) ?? 0, 3)} s.`
        : `${title}: no values.`;
      return {
        title: `${title} over time`,
        y_label: `${title} (${unit})`,
        quantity,
        limits:
          unit === 'mm'
            ? limitsOf(quantity, requirements, 1000, (m) => said(m, 'm'))
            : limitsOf(quantity, requirements, 1, (v) => said(v, unit)),
        summary,
        series: [{ label: `${title} (${unit})`, values, ...curve }],
      };
    };
    const scaled = (name, factor) => (columns[name] ?? []).map((v) => (v === null ? null : v * factor));
    return {
      t,
      bands,
      plots: [
        plot('Force', 'N', 'force', forceOf(columns), kCurves[0]),
        plot('Depth', 'mm', 'depth', scaled('insertion_m', 1000), kCurves[2]),
        plot('Speed', 'mm/s', 'speed', scaled('speed_m_s', 1000), kCurves[3]),
      ],
    };
  }, [columns, profile, requirements]);
  return html`
    <div class="actions">
      <p class="help">Drag over a plot to zoom in; click to move the replay there.</p>
      ${window && html`<button type="button" onClick=${() => zoom(null)}>Show the whole recording</button>`}
      ${busy && html`<span role="status">Loading …</span>`}
    </div>
    ${drawn.plots.map(
      (p) =>
        html`<${Chart}
          key=${p.title}
          ...${p}
          x=${{ label: 'Time (s)', values: drawn.t }}
          bands=${drawn.bands}
          marks=${marks}
          at=${at}
          onPick=${seek}
          onZoom=${(from_s, to_s) => zoom({ from_s: Math.max(0, from_s), to_s })}
          sync="session"
          height=${190}
        />`,
    )}
  `;
}

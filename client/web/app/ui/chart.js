// A plot by uPlot: curves with different dashes, bands of tissue behind them, marks, and a text for people who cannot
// see it.
import uPlot from '../../vendor/uPlot.js';
import { axisRange } from '../lib/axis.js';
import { number } from '../lib/units.js';
import { html, useEffect, useRef } from './html.js';

/**
 * @typedef {object} ChartProps
 * @property {string} title
 * @property {string} summary what the plot shows, in words
 * @property {{label: string, values: number[]}} x in shown units
 * @property {{label: string, values: (number|null)[], color: string, dash: number[], width?: number}[]} series in shown units
 * @property {string} y_label
 * @property {string} [quantity] of the y axis: determines its least span (lib/axis.js)
 * @property {import('../lib/axis.js').Limit[]} [limits] of the exercise, always within the axis
 * @property {{from: number, to: number, label: string, color: string}[]} [bands] along x
 * @property {{x: number, label: string}[]} [marks]
 * @property {number} [at] a line that moves: the time of a replay
 * @property {(x: number) => void} [onPick] a click
 * @property {(from: number, to: number) => void} [onZoom] a stretch drawn with the mouse
 * @property {string} [sync] plots of one name share the cursor
 * @property {number} [height]
 * @property {boolean} [points] single values: each is drawn as a dot, x in whole numbers
 */

// single values are numbered: there is no attempt 1.5
const kWholeSteps = [1, 2, 5, 10, 20, 50, 100];
const kInk = '#1b2630',
  kLine = '#c3ccd3',
  kFont = '12px system-ui, sans-serif';

function drawBands(plot, bands) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  const ratio = devicePixelRatio;
  for (const band of bands) {
    const left = plot.valToPos(band.from, 'x', true),
      right = plot.valToPos(band.to, 'x', true);
    ctx.globalAlpha = 0.45;
    ctx.fillStyle = band.color;
    ctx.fillRect(left, bbox.top, right - left, bbox.height);
    ctx.globalAlpha = 1;
    ctx.fillStyle = kInk;
    ctx.font = `${11 * ratio}px system-ui, sans-serif`;
    const text = band.label,
      width = ctx.measureText(text).width;
    const middle = (Math.max(left, bbox.left) + Math.min(right, bbox.left + bbox.width)) / 2;
    if (Math.min(right, bbox.left + bbox.width) - Math.max(left, bbox.left) > width + 6 * ratio)
      ctx.fillText(text, middle - width / 2, bbox.top + 13 * ratio);
  }
  ctx.restore();
}

function drawMarks(plot, marks, at) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.lineWidth = 1.5 * devicePixelRatio;
  const line = (x, color, dash) => {
    const left = plot.valToPos(x, 'x', true);
    if (left < bbox.left || left > bbox.left + bbox.width) return;
    ctx.strokeStyle = color;
    ctx.setLineDash(dash);
    ctx.beginPath();
    ctx.moveTo(left, bbox.top);
    ctx.lineTo(left, bbox.top + bbox.height);
    ctx.stroke();
  };
  for (const mark of marks) line(mark.x, '#6a2c91', [4, 4]);
  if (at !== undefined) line(at, '#d3590a', []);
  ctx.restore();
}

/** Limits as dashed lines, their words at the right end: below the line, or above it at the lower edge. */
function drawLimits(plot, limits) {
  const { ctx, bbox } = plot,
    ratio = devicePixelRatio;
  ctx.save();
  ctx.font = `${11 * ratio}px system-ui, sans-serif`;
  for (const limit of limits) {
    const top = plot.valToPos(limit.at, 'y', true);
    ctx.strokeStyle = ctx.fillStyle = '#a11d1d';
    ctx.lineWidth = 1.5 * ratio;
    ctx.setLineDash([6 * ratio, 4 * ratio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, top);
    ctx.lineTo(bbox.left + bbox.width, top);
    ctx.stroke();
    const below = top + 14 * ratio < bbox.top + bbox.height;
    ctx.fillText(
      limit.label,
      bbox.left + bbox.width - ctx.measureText(limit.label).width - 4 * ratio,
      below ? top + 12 * ratio : top - 4 * ratio,
    );
  }
  ctx.restore();
}

/** @param {ChartProps} props */
export function Chart(props) {
  const { title, summary, x, series, y_label, sync, height = 240, points = false } = props;
  const place = useRef(null),
    plot = useRef(null),
    latest = useRef(props);
  latest.current = props;
  const shape = JSON.stringify([title, x.label, y_label, points, series.map((s) => [s.label, s.color, s.dash])]);
  const data = () => [latest.current.x.values, ...latest.current.series.map((s) => s.values)];

  useEffect(() => {
    const axis = {
      stroke: kInk,
      font: kFont,
      labelFont: kFont,
      grid: { stroke: kLine, width: 1 },
      ticks: { stroke: kLine },
      values: (_, all) => all.map((v) => number(v, 4)),
    };
    const made = new uPlot(
      {
        width: Math.max(200, place.current.clientWidth),
        height,
        scales: {
          x: { time: false, ...(points ? { range: (_, low, high) => [low - 0.25, high + 0.25] } : {}) },
          y: { range: (_, low, high) => axisRange(low, high, latest.current.quantity, latest.current.limits) },
        },
        axes: [
          { ...axis, label: x.label, labelSize: 22, ...(points ? { incrs: kWholeSteps } : {}) },
          { ...axis, label: y_label, size: 56, labelSize: 22 },
        ],
        series: [
          { label: x.label, value: (_, v) => (v === null ? '–' : number(v, 4)) },
          ...series.map((s) => ({
            label: s.label,
            stroke: s.color,
            dash: s.dash,
            width: s.width ?? 2,
            points: { show: points, size: 7 },
            value: (_, v) => (v === null || v === undefined ? '–' : number(v, 3)),
          })),
        ],
        cursor: {
          drag: { x: true, y: false, setScale: !latest.current.onZoom },
          ...(sync ? { sync: { key: sync } } : {}),
        },
        // the legend's sign has the same dashes as the curve
        legend: {
          markers: {
            width: 3,
            dash: (_, i) => {
              const dash = series[i - 1]?.dash ?? [];
              return dash.length === 0 ? 'solid' : dash[0] <= 2 ? 'dotted' : 'dashed';
            },
          },
        },
        hooks: {
          drawClear: [(u) => drawBands(u, latest.current.bands ?? [])],
          draw: [
            (u) => {
              drawLimits(u, latest.current.limits ?? []);
              drawMarks(u, latest.current.marks ?? [], latest.current.at);
            },
          ],
          setSelect: [
            (u) => {
              const { left, width } = u.select,
                { onZoom } = latest.current;
              if (!onZoom || width < 4) return;
              u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
              onZoom(u.posToVal(left, 'x'), u.posToVal(left + width, 'x'));
            },
          ],
        },
      },
      data(),
      place.current,
    );
    made.over.addEventListener('click', (event) => {
      if (made.select.width < 4) latest.current.onPick?.(made.posToVal(event.offsetX, 'x'));
    });
    plot.current = made;
    const observer = new ResizeObserver(([entry]) =>
      made.setSize({ width: Math.max(200, entry.contentRect.width), height }),
    );
    observer.observe(place.current);
    return () => {
      observer.disconnect();
      made.destroy();
    };
  }, [shape]);
  useEffect(() => plot.current?.setData(data()), [x.values, props.limits, ...series.map((s) => s.values)]);
  useEffect(() => plot.current?.redraw(false), [props.bands, props.marks, props.at]);

  return html`<figure class="chart">
    <figcaption>${title}</figcaption>
    <div ref=${place} role="group" aria-label=${title}></div>
    <p class="visually-hidden">${summary}</p>
  </figure>`;
}

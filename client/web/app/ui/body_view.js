// A cut through a body, to scale: its structures with their names, and the targets.
import { areasOf, inSection } from '../lib/body.js';
import { spread } from '../lib/scene.js';
import { atStart, quantity } from '../lib/units.js';
import { useWidth } from './hooks.js';
import { html, useMemo } from './html.js';

const kWidth = 640,
  kLetter_px = 6.6, // of a name, 12 px high
  kGap = 17;

/** @param {{section: any, profile: any, label: string}} props */
export function BodyView({ section, profile, label }) {
  const targets = profile.targets ?? [],
    ids = (profile.volume?.structures ?? []).map((s) => s.id),
    isTarget = (area) => targets.some((t) => t.structure && t.structure === ids[area.index]);
  const [place, room] = useWidth(kWidth);
  const areas = useMemo(() => areasOf(section), [section]);
  const longest = Math.max(0, ...areas.map((area) => area.name.length)),
    width = Math.max(320, room),
    names_px = Math.min(width / 2, 26 + kLetter_px * (longest + 2)),
    scale = (width - names_px) / section.columns,
    height = section.rows * scale,
    edge = section.columns * scale;
  const labels = areas
    .map((area) => ({
      x: area.at.x * scale,
      y: area.at.y * scale,
      text: (isTarget(area) ? '◎ ' : '') + atStart(area.name),
    }))
    .sort((a, b) => a.y - b.y);
  const slots = spread(
    labels.map((l) => l.y),
    kGap,
    12,
    Math.max(height - 6, 12 + kGap * labels.length),
  );
  const px_per_m = scale / section.point_m,
    ruler_m = 0.01;
  return html`<svg
    ref=${place}
    class="section"
    viewBox=${`0 0 ${width} ${Math.max(height, slots.at(-1) ?? 0) + 8}`}
    role="img"
    aria-label=${label}
  >
    <rect class="section-air" x="0" y="0" width=${edge} height=${height} />
    <g transform=${`scale(${scale})`} shape-rendering="crispEdges">
      ${areas.map((area) => html`<path d=${area.path} fill=${area.color}><title>${area.name}</title></path>`)}
    </g>
    ${targets.map((target) => {
      if (!target.center_m) return ''; // a structure: its name has a mark
      const at = inSection(section, target.center_m);
      return html`<circle
        class="shape-target"
        cx=${at.x * scale}
        cy=${at.y * scale}
        r=${Math.max(2, Number(target.radius_m) * px_per_m || 0)}
      >
        <title>${`target: ${target.name}`}</title>
      </circle>`;
    })}
    ${labels.map(
      (l, i) => html`
        <circle class="leader-dot" cx=${l.x} cy=${l.y} r="2" />
        <polyline class="leader" points=${`${l.x},${l.y} ${edge + 8},${slots[i]} ${edge + 16},${slots[i]}`} />
        <text x=${edge + 19} y=${slots[i] + 4}>${l.text}</text>
      `,
    )}
    <g class="ruler">
      <line x1="10" y1=${height - 10} x2=${10 + ruler_m * px_per_m} y2=${height - 10} />
      <text x="10" y=${height - 15}>${quantity(ruler_m, 'm')}</text>
    </g>
  </svg>`;
}

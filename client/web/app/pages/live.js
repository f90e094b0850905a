// The state of the lab now. The line reconnects by itself, and the page shows its state.
import { isPractising, stationState, tileState, traineeWords } from '../lib/lab.js';
import { href } from '../lib/routes.js';
import { atStart, counted, quantity } from '../lib/units.js';
import { may } from '../lib/roles.js';
import { followLab } from '../net/live.js';
import { html, useEffect, useRef, useState } from '../ui/html.js';
import { useEvery, useExerciseName } from '../ui/hooks.js';
import { Empty, Heading, Mark } from '../ui/widgets.js';

const kFullForce_N = 10,
  kFullDepth_m = 0.08;

function Gauge({ label, value, full, unit, peak }) {
  const share = Math.max(0, Math.min(1, value / full)),
    peak_share = Math.max(0, Math.min(1, (peak ?? 0) / full));
  return html`<div class="gauge">
    <span>${label}</span>
    <svg viewBox="0 0 100 8" preserveAspectRatio="none" aria-hidden="true">
      <rect class="gauge-room" width="100" height="8" />
      <rect class="gauge-value" width=${share * 100} height="8" />
      ${peak > 0 && html`<rect class="gauge-peak" x=${peak_share * 100 - 1} width="1.5" height="8" />`}
    </svg>
    <span class="gauge-number">${quantity(value, unit, { digits: 2 })}</span>
  </div>`;
}

function Tile({ tile, person, nameOf }) {
  const force = tile.force_n ?? 0,
    peak = tile.peak_force_n ?? 0;
  const [kind, word] = tileState(tile);
  return html`<li class=${'tile live-tile' + (tile.fault ? ' live-fault' : '')} aria-label=${`Station ${tile.station}`}>
    <div class="card-head"><h2>${tile.station}</h2><${Mark} kind=${kind}>${word}<//></div>
    ${tile.server && html`<p class="help">Server ${tile.server}</p>`}
    ${tile.fault && html`<p class="error">✗ ${tile.fault}</p>`}
    ${
      isPractising(tile)
        ? html`
            <p>
              <strong>${
                tile.trainee && may(person.role, 'see people')
                  ? html`<a href=${href(['people', tile.trainee])}>${traineeWords(tile)}</a>`
                  : traineeWords(tile)
              }</strong>, ${nameOf(tile.exercise)}
            </p>
            <p>${atStart(tile.phase)}${tile.layer ? `, tip in ${tile.layer}` : ''}</p>
            <${Gauge} label="Depth" value=${tile.depth_m ?? 0} full=${kFullDepth_m} unit="m" />
            <${Gauge} label="Force" value=${force} peak=${peak} full=${kFullForce_N} unit="N" />
            <p class="help">
              Peak ${quantity(peak, 'N')}
              ${tile.drops > 0 ? `; the loop missed ${counted(tile.drops, 'tick')}` : ''}
            </p>
          `
        : html`<p class="help">${tile.online ? 'No one is practising here.' : 'The station is not connected.'}</p>`
    }
  </li>`;
}

function Line({ line, retry }) {
  const [, setTurn] = useState(0);
  useEvery(500, () => line.state === 'waiting' && setTurn((t) => t + 1));
  const seconds = Math.max(0, Math.ceil((line.next_try_ms - Date.now()) / 1000));
  const mark = {
    live: html`<${Mark} kind="good">live<//>`,
    connecting: html`<${Mark} kind="open">connecting<//>`,
    waiting: html`<${Mark} kind="bad">interrupted<//>`,
  }[line.state];
  return html`<p class="line-state">
    <span role="status" aria-label="Connection">${mark}</span> ${
      line.state === 'waiting' &&
      html`
        <span>This is out of date. Next try in ${seconds} s.</span> <button
          type="button"
          class="small"
          onClick=${retry}
        >
          Try now
        </button>
      `
    }
  </p>`;
}

/** Tiles of each state that the address may name; Home links to them. */
const kShown = { practising: 'practising', idle: 'idle', trouble: 'in trouble' };

export function LivePage({ query, person }) {
  const [tiles, setTiles] = useState(null);
  const [line, setLine] = useState({ state: 'connecting', next_try_ms: 0 });
  const [trouble, setTrouble] = useState('');
  const [missing, setMissing] = useState('');
  const follower = useRef(null);
  useEffect(() => {
    follower.current = followLab(
      (next, live_trouble) => {
        setTiles(next);
        setMissing(live_trouble);
        // announced once when it changes, not five times a second
        setTrouble(
          next
            .filter((t) => t.fault)
            .map((t) => `${t.station}: ${t.fault}`)
            .join('; '),
        );
      },
      (next) =>
        setLine((before) => (before.state === next.state && before.next_try_ms === next.next_try_ms ? before : next)),
    );
    return () => follower.current.stop();
  }, []);
  const nameOf = useExerciseName();
  const busy = (tiles ?? []).filter(isPractising).length;
  const shown = (tiles ?? []).filter((tile) => !kShown[query.show] || stationState(tile) === query.show);
  return html`
    <${Heading} title="Live lab" />
    <${Line} line=${line} retry=${() => follower.current.retry()} />
    <div role="alert" class="visually-hidden">${trouble}</div>
    <div role="status">${
      missing && html`<p><${Mark} kind="bad">incomplete<//> ${missing}: stations of other servers may be missing.</p>`
    }</div>
    ${
      tiles === null
        ? html`<p class="loading">Waiting for the first picture …</p>`
        : tiles.length === 0
          ? html`<${Empty} title="There are no stations yet">
              An administrator adds one with “needlelab-admin station add”; it appears here when it connects.
            <//>`
          : html`
              <p>
                ${busy} of ${counted(tiles.length, 'station')} ${busy === 1 ? 'is' : 'are'} in use.
                ${
                  kShown[query.show] &&
                  html` Shown: ${shown.length} ${kShown[query.show]}. <a href="#/live">Show all</a>`
                }
              </p>
              <ul class=${'tiles' + (line.state === 'live' ? '' : ' live-old')}>${shown.map(
                (tile) => html`<${Tile} key=${tile.station} tile=${tile} person=${person} nameOf=${nameOf} />`,
              )}</ul>
            `
    }
  `;
}

// The replay of the tip in two views: from the side, in the plane of the insertion, and from above.
import { minMax } from '../lib/decimate.js';
import { contactWords, forceOf, kSpeeds, sampleAt, wayOf } from '../lib/recording.js';
import { clock } from '../lib/time.js';
import { layerNames } from '../lib/tissue.js';
import { quantity } from '../lib/units.js';
import { SelectField } from '../ui/fields.js';
import { html, useId, useMemo } from '../ui/html.js';
import { Legend, SideView, TopView } from '../ui/section.js';

const kTrail = 400;

/** Tip, needle and trail in one view. */
function Tip({ way, at_s, x, y, second, length_m }) {
  const i = sampleAt(way, at_s),
    here = way.points[i],
    lean = way.axes[i];
  const trail = useMemo(() => {
    const step = Math.max(1, Math.floor(way.points.length / kTrail));
    return way.points.map((p, k) => ({ p, k })).filter(({ k }) => k % step === 0);
  }, [way]);
  if (!here) return null;
  const done = trail
    .filter(({ k }) => k <= i)
    .map(({ p }) => `${x(p.u).toFixed(1)},${y(p[second]).toFixed(1)}`)
    .join(' ');
  const hub = { u: here.u - lean.u * length_m, w: here[second] - lean[second] * length_m };
  return html`
    <polyline class="tip-path" points=${done} />
    <line class="tip-needle" x1=${x(hub.u)} y1=${y(hub.w)} x2=${x(here.u)} y2=${y(here[second])} />
    <circle class="tip-now" cx=${x(here.u)} cy=${y(here[second])} r="5" />
  `;
}

/** The tip's path in a limb. @param {{columns: any, profile: any, placement: number[], at_s: number}} props */
function Views({ columns, profile, placement, at_s }) {
  const way = useMemo(() => wayOf(columns, profile, placement), [columns, profile, placement]);
  const length_m = profile.needle?.length_m ?? 0.05;
  const half_m = useMemo(
    () =>
      Math.max(
        0.006,
        ...minMax(
          way.t_s,
          way.points.map((p) => Math.hypot(p.u, p.v) * (p.d > -0.005 ? 1 : 0)),
          200,
        ).y,
      ) * 1.3,
    [way],
  );
  const tip =
    (second) =>
    ({ x, y }) =>
      html`<${Tip} way=${way} at_s=${at_s} x=${x} y=${y} second=${second} length_m=${length_m} />`;
  return html`
    <div class="replay-views">
      <div>
        <h3>Side view</h3>
        <${SideView}
          profile=${profile}
          frame=${way.frame}
          to_m=${way.deepest_m * 1.1}
          label="Side view of the tip's path through the layers"
          over=${tip('d')}
        />
      </div>
      <div>
        <h3>From above</h3>
        <${TopView}
          profile=${profile}
          frame=${way.frame}
          half_m=${half_m}
          label="View of the tip's path from above"
          over=${tip('v')}
        />
      </div>
    </div>
    <${Legend} profile=${profile} path />
  `;
}

/** The contacts of one kind, with a button for each moment that is shown. */
function Contacts({ kind, measures, seek }) {
  const said = contactWords(measures, kind);
  if (!said) return null;
  return html`<div class="actions">
    <span>✗ ${said.many}; ${said.moments}${kind.moments_s.length > 0 && ':'}</span>
    ${kind.moments_s.map(
      (t) =>
        html`<button
          type="button"
          class="small"
          aria-label=${`Go to the ${kind.name} at ${clock(t)}`}
          onClick=${() => seek(t)}
        >
          ${clock(t)}
        </button>`,
    )}
  </div>`;
}

/** @param {{columns: any, session: any, contacts: import('../lib/recording.js').ContactsOfKind[], measures: any[]|undefined, playback: import('../lib/recording.js').Playback, act: {toggle: () => void, seek: (s: number) => void, speed: (n: number) => void}}} props */
export function Replay({ columns, session, contacts, measures, playback, act }) {
  const id = useId();
  const { profile, placement } = session.description;
  const force = useMemo(() => forceOf(columns), [columns]);
  const keys = (event) => {
    if (event.target.closest('input, select, button')) return;
    const step = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key];
    if (event.key === ' ') act.toggle();
    else if (step) act.seek(playback.at_s + step);
    else return;
    event.preventDefault();
  };
  const i = sampleAt(columns, playback.at_s),
    layer = columns.layer?.[i] ?? -1;
  const name = layerNames(profile)[layer] ?? `layer ${layer + 1}`;
  const where = layer >= 0 ? `in ${name}, ${quantity(columns.insertion_m?.[i], 'm')} deep` : 'outside';
  const place = `${clock(playback.at_s)}: ${where}, ${quantity(force[i], 'N')}`;
  return html`<div class="replay" role="group" aria-label="Replay of the tip" tabindex="0" onKeyDown=${keys}>
    ${
      profile.volume
        ? html`<p class="help">This patient is a body: the instructor's window shows the needle in it.</p>`
        : html`<${Views} columns=${columns} profile=${profile} placement=${placement} at_s=${playback.at_s} />`
    }
    <div class="actions">
      <button type="button" class="main" onClick=${act.toggle}>${playback.playing ? 'Pause' : 'Play'}</button>
      <label for=${id}>Moment</label>
      <input
        id=${id}
        class="seek"
        type="range"
        min=${playback.from_s}
        max=${playback.to_s}
        step="0.01"
        value=${playback.at_s}
        aria-valuetext=${place}
        list=${`${id}-marks`}
        onInput=${(event) => act.seek(Number(event.target.value))}
      />
      <datalist id=${`${id}-marks`}>${contacts.map(({ name, moments_s }) => moments_s.map((t) => html`<option value=${t.toFixed(2)}>${name}</option>`))}</datalist>
      <${SelectField}
        label="Speed"
        value=${String(playback.speed)}
        options=${kSpeeds.map((s) => [String(s), `${s}×`])}
        onValue=${(s) => act.speed(Number(s))}
      />
    </div>
    <p class="replay-now">${place}</p>
    ${contacts.map((kind) => html`<${Contacts} kind=${kind} measures=${measures} seek=${act.seek} />`)}
  </div>`;
}

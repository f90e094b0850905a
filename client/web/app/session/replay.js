// The replay of the tip: from the side, in the plane of the insertion, and from above; in a body, in its cut there.
import { besideCut } from '../lib/body.js';
import { minMax } from '../lib/decimate.js';
import {
  contactWords,
  forceOf,
  isCapped,
  kSpeeds,
  momentWords,
  sampleAt,
  wayInSection,
  wayOf,
} from '../lib/recording.js';
import { clock } from '../lib/time.js';
import { layerNames } from '../lib/tissue.js';
import { sessions } from '../net/requests.js';
import { BodyView } from '../ui/body_view.js';
import { SelectField } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useId, useMemo } from '../ui/html.js';
import { Legend, SideView, TopView } from '../ui/section.js';
import { Loaded } from '../ui/widgets.js';

const kTrail = 400,
  kCap_m = 0.003; // radius of the capped tip, if the profile does not say it

/** Tip, needle and trail in one view. @param {any} props `cap_px`: radius of the tip's cap while it is on */
export function Tip({ way, at_s, x, y, second, length_m, cap_px }) {
  const i = sampleAt(way, at_s),
    here = way.points[i],
    lean = way.axes[i];
  if (!here) return null;
  const step = Math.max(1, Math.floor(way.points.length / kTrail));
  let done = '';
  for (let k = 0; k <= i; k += step) done += `${x(way.points[k].u).toFixed(1)},${y(way.points[k][second]).toFixed(1)} `;
  const hub = { u: here.u - lean.u * length_m, w: here[second] - lean[second] * length_m };
  return html`
    <polyline class="tip-path" points=${done} />
    <line class="tip-needle" x1=${x(hub.u)} y1=${y(hub.w)} x2=${x(here.u)} y2=${y(here[second])} />
    <circle
      class=${cap_px ? 'tip-cap' : 'tip-now'}
      cx=${x(here.u)}
      cy=${y(here[second])}
      r=${cap_px ? Math.max(5, cap_px) : 5}
    />
  `;
}

/** The tip's path in the cut of a body. @param {{section: any, columns: any, profile: any, placement: number[], at_s: number}} props */
function InBody({ section, columns, profile, placement, at_s }) {
  const way = useMemo(() => wayInSection(columns, section, placement), [columns, section, placement]);
  const i = sampleAt(way, at_s);
  const cap_m = isCapped(columns, i) ? (profile.palpation?.radius_m ?? kCap_m) : 0;
  const tip = ({ x, y, scale }) =>
    html`<${Tip}
      way=${way}
      at_s=${at_s}
      x=${x}
      y=${y}
      second="w"
      length_m=${profile.needle?.length_m ?? 0.05}
      cap_px=${cap_m * scale}
    />`;
  return html`
    <${BodyView}
      section=${section}
      profile=${profile}
      label="Cut through the body where the needle first came in, with the tip's path"
      over=${tip}
    />
    <p class="help">${besideCut(way.points[i]?.v ?? 0)}</p>
    <${Legend} profile=${profile} path cap=${columns.capped?.some((on) => on > 0)} />
  `;
}

/** The server cuts the body. @param {{id: string, columns: any, profile: any, placement: number[], at_s: number}} props */
function Body({ id, ...shown }) {
  const load = useLoad((signal) => sessions.section(id, signal), [id]);
  return html`<${Loaded} load=${load}>${(section) => html`<${InBody} section=${section} ...${shown} />`}<//>`;
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

/** The contacts of one kind, with a button for each moment that is shown; their number is the score's. */
function Contacts({ kind, measures, seek }) {
  const said = contactWords(measures, kind);
  if (!said) return null;
  return html`<div class="actions">
    <span>✗ ${said}</span>
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
  const { session_id, profile, placement } = session.description;
  const force = useMemo(() => forceOf(columns), [columns]);
  const keys = (event) => {
    if (event.target.closest('input, select, button')) return;
    const step = { ArrowLeft: -0.1, ArrowRight: 0.1 }[event.key];
    if (event.key === ' ') act.toggle();
    else if (step) act.seek(playback.at_s + step);
    else return;
    event.preventDefault();
  };
  const i = sampleAt(columns, playback.at_s);
  const place = momentWords(columns, i, playback.at_s, layerNames(profile), force[i]);
  const shown = { columns, profile, placement, at_s: playback.at_s };
  return html`<div
    class=${`replay ${profile.volume ? 'replay-in-body' : ''}`}
    role="group"
    aria-label="Replay of the tip"
    tabindex="0"
    onKeyDown=${keys}
  >
    <div class="replay-controls">
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
    </div>
    <div>${profile.volume ? html`<${Body} id=${session_id} ...${shown} />` : html`<${Views} ...${shown} />`}</div>
  </div>`;
}

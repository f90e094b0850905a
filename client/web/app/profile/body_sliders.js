// Build, fat, size and side of a body as sliders.
import { fatOf, fitOf, isWhole, mirrorAxis, outline, reshaped, sideOf } from '../lib/reshape.js';
import { atStart, number, quantity } from '../lib/units.js';
import { documents } from '../net/requests.js';
import { SelectField } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useId, useMemo, useRef, useState } from '../ui/html.js';

const kStart = { build: 0, size: 1, mirrored: '', fat_m: 0 };
const kLeastFat_m = 0.001;
const kNote = / ?Changed in the editor: [^.]*\.(?:\d[^.]*\.)*$/;

/** The stored slender, median and heavy body with the same shapes; null: there are none. */
async function familyOf(body, signal) {
  const store = documents('profiles'),
    ids = (await store.all(signal)).map(({ id }) => id),
    regions = ids.filter((id) => id.endsWith('-median')).map((id) => id.slice(0, -'median'.length)),
    mine = outline(body);
  const three = (region) => ['slender', 'median', 'heavy'].map((build) => region + build);
  const likely = (region) => (String(body.id).startsWith(region) ? 0 : 1);
  for (const region of regions.sort((a, b) => likely(a) - likely(b))) {
    if (!three(region).every((id) => ids.includes(id))) continue;
    const { json } = await store.one(`${region}median`, undefined, signal);
    if (outline(json) !== mine) continue;
    const family = await Promise.all(three(region).map((id) => store.one(id, undefined, signal)));
    return family.every((one) => outline(one.json) === mine) ? family.map((one) => one.json) : null;
  }
  return null;
}

const buildWords = (t) =>
  Math.abs(t) < 0.005 ? 'median' : `${number(Math.round(100 * Math.abs(t)))} % to ${t < 0 ? 'slender' : 'heavy'}`;
const percent = (size) => `${number(Math.round(1000 * size) / 10)} %`;

/** @param {{label: string, value: number, words: string, why?: string, onValue: (value: number) => void, onEnd: () => void, [more: string]: any}} props `why`: why it cannot be moved */
function Slider({ label, value, words, why, onValue, onEnd, disabled, ...range }) {
  const id = useId();
  return html`<div class="slider">
    <label for=${id}>${label}</label>
    <input
      type="range"
      id=${id}
      value=${value}
      aria-valuetext=${words}
      aria-describedby=${why ? id + '-why' : undefined}
      disabled=${disabled || !!why}
      onInput=${(event) => onValue(Number(event.target.value))}
      onChange=${onEnd}
      ...${range}
    />
    <output for=${id}>${why ? '–' : words}</output>
    ${why && html`<p class="help" id=${id + '-why'}>${why}</p>`}
  </div>`;
}

/** What the sliders did, at the end of the body's sources. */
function noted(doc, { build, size, mirrored }, family) {
  const said = [
    family && `build ${buildWords(build)}`,
    `subcutaneous fat ${quantity(fatOf(doc), 'm')}`,
    `size ${percent(size)}`,
    mirrored && 'mirrored',
  ].filter((words) => words && !/–|size 100 %/.test(words));
  const sources = (doc.sources ?? '').replace(kNote, '');
  return { ...doc, sources: `${sources}${sources && ' '}Changed in the editor: ${said.join(', ')}.` };
}

/**
 * @param {{whole: any, change: (next: any) => void, port: any, readonly?: boolean}} props `whole`: the document, changed
 *   when a slider is let go; `port`: to the section (profile/body_look.js)
 */
export function BodySliders({ whole, change, port, readonly }) {
  const shapes = useMemo(() => outline(whole), [whole.volume]);
  const load = useLoad((signal) => familyOf(whole, signal), [shapes]);
  // moving a slider begins at the last document that something else made: steps add up without rounding
  const mark = useRef(null),
    made = useRef(null);
  const [state, setState] = useState({ family: null, found: undefined, ...kStart });
  if (load.data !== state.found) {
    const fit = load.data && isWhole(whole) && fitOf(whole, load.data);
    setState({ ...kStart, ...fit, family: fit ? load.data : null, found: load.data });
    mark.current = null;
  }
  const is_loaded = state.found !== undefined || !!load.error;
  const shown = state.moving ?? whole;
  const is_whole = isWhole(whole),
    is_ready = is_loaded && is_whole && !readonly,
    fat_m = is_whole ? fatOf(shown) : undefined;
  /** @param {{build?: number, size?: number, mirrored?: string}} to @param {number} [fat_to_m] its thickness then */
  const move = (to, fat_to_m) => {
    const goes_on = mark.current && [whole, state.moving].includes(made.current);
    if (!goes_on) mark.current = { doc: whole, at: state, up: port.current.up };
    const bare = { ...state, ...to, fat_m: 0 };
    const more_m = fat_to_m === undefined ? null : fat_to_m - fatOf(reshaped(mark.current, bare, state.family));
    const next = { ...bare, fat_m: more_m ?? (goes_on ? state.fat_m : 0) };
    made.current = noted(reshaped(mark.current, next, state.family), next, state.family);
    setState({ ...next, moving: made.current });
    port.current.show?.(made.current);
  };
  const end = () => {
    setState((before) => ({ ...before, moving: null }));
    change(made.current);
    port.current.show?.(null);
  };
  const side = sideOf(shown),
    other = side === 'left' ? 'right' : 'left';
  const now = side ?? (state.mirrored ? 'mirrored' : 'as made');
  const options = side ? [side, other] : ['as made', 'mirrored'];
  return html`<fieldset class="sliders">
    <legend>Body</legend>
    <${Slider}
      label="Build"
      min="-1"
      max="1"
      step="0.02"
      value=${state.build}
      words=${state.family ? buildWords(state.build) : '…'}
      disabled=${!is_ready}
      why=${is_loaded && !state.family ? (load.error?.message ?? 'No stored slender, median and heavy body has these shapes.') : ''}
      onValue=${(build) => move({ build })}
      onEnd=${end}
    />
    <${Slider}
      label="Fat"
      min=${kLeastFat_m * 1e3}
      max=${Math.max(40, Math.ceil((fat_m ?? 0) * 1e3))}
      step="0.1"
      value=${(fat_m ?? 0) * 1e3}
      words=${quantity(fat_m, 'm')}
      disabled=${!is_ready}
      why=${fat_m === undefined ? 'No rule of this body puts a layer of fat under its skin.' : ''}
      onValue=${(mm) => move({}, mm * 1e-3)}
      onEnd=${end}
    />
    <${Slider}
      label="Size"
      min="80"
      max="125"
      step="0.5"
      value=${state.size * 100}
      words=${percent(state.size)}
      disabled=${!is_ready}
      onValue=${(value) => move({ size: value / 100 })}
      onEnd=${end}
    />
    <${SelectField}
      label="Side"
      value=${now}
      disabled=${!is_ready}
      options=${options.sort().map((word) => [word, atStart(word)])}
      onValue=${(word) => {
        if (word === now) return;
        move({ mirrored: state.mirrored ? '' : mirrorAxis(whole) });
        end();
      }}
    />
  </fieldset>`;
}

// A body's section with the planned line, and what a hand on that line feels.
import { shifted } from '../lib/reshape.js';
import { quantity } from '../lib/units.js';
import { BodyView } from '../ui/body_view.js';
import { html, useState } from '../ui/html.js';
import { Legend } from '../ui/section.js';
import { PlanGrips, planOf } from './plan_grips.js';
import { usePreview, useSection } from './preview.js';
import { TryIt } from './try_it.js';

/** A little behind the target, within what the server takes. */
const reach = (length_m) => Math.min(1, Math.max(0.001, length_m + 0.002)).toFixed(4);

/**
 * @param {{f: any, whole: any, of: string[], choose: (index: number) => void, port: any}} props `whole`: the document;
 *   `of`: as in TryIt; `choose`: a structure was clicked; `port.current` gets `show`, which draws another body until it
 *   is called with null, and `up`, the skin's normal where the needle enters
 */
export function BodyLook({ f, whole, of, choose, port }) {
  const [moving, setMoving] = useState(null);
  const { section, error } = useSection(moving ?? whole);
  const [tried, setTried] = useState(false);
  const profile = moving ?? f.doc,
    plan = planOf(profile, section);
  const rendered = usePreview(tried && plan ? whole : null, plan ? reach(plan.length_m) : undefined);
  port.current.show = setMoving;
  port.current.up = section && { x: section.upward[0], y: section.upward[1], z: section.upward[2] };
  const is_fixed = f.readonly || moving;
  const grips = ({ scale }) =>
    plan &&
    html`<${PlanGrips}
      section=${section}
      target_m=${plan.target_m}
      scale=${scale}
      onTarget=${is_fixed ? undefined : f.set('targets[0].center_m')}
      onEntry=${is_fixed ? undefined : (at) => f.change((before) => shifted(before, { x: -at.x, y: -at.y, z: -at.z }))}
    />`;
  return html`<section>
    ${
      section
        ? html`<${BodyView}
            section=${section}
            profile=${profile}
            label=${`Cut through ${profile.name || 'the body'} along the skin’s normal at the place of insertion`}
            over=${grips}
            onPick=${choose}
          />`
        : html`<p class="help" role="status">${error?.message ?? 'Asking the server …'}</p>`
    }
    ${!tried && html`<${Legend} profile=${profile} />`}
    ${section && error && html`<p class="warning">! This is the last version that could be drawn: ${error.message}</p>`}
    <div class="actions">
      <button type="button" disabled=${!plan} onClick=${() => setTried(!tried)}>${tried ? 'Hide the trial' : 'Try it'}</button>
      <span>${
        plan
          ? `Plan: ${quantity(plan.length_m, 'm')} to the target, ${quantity(plan.off_normal_rad, 'rad', { digits: 2 })} off the skin’s normal`
          : 'A first target with a point to aim at gives a planned line.'
      }</span>
    </div>
    ${tried && plan && html`<${TryIt} profile=${profile} rendered=${rendered} plan=${plan} of=${of} />`}
  </section>`;
}

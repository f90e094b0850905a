// Edits a patient: the drawing and the force on one side, the form on the other.
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { layerBounds } from '../lib/scene.js';
import { kProfileShape } from '../lib/shape.js';
import { followLayerNames } from '../lib/tissue.js';
import { counted, quantity } from '../lib/units.js';
import { checkProfile, documents } from '../net/requests.js';
import { ConflictDialog } from '../ui/conflict.js';
import { useDocument } from '../ui/document.js';
import { AsJson } from '../ui/as_json.js';
import { formOf, ProblemList } from '../ui/fields.js';
import { DraftBack, draftOf } from '../ui/draft.js';
import { released, useDebounced } from '../ui/hooks.js';
import { html, useCallback, useEffect, useRef, useState } from '../ui/html.js';
import { DangerButton, Heading, Mark, Problem } from '../ui/widgets.js';
import { Legend, SideView } from '../ui/section.js';
import { DirectionFields, Hazards, LimbFields, Targets } from '../profile/anatomy.js';
import { Layers } from '../profile/layers.js';
import { Structures } from '../profile/structures.js';
import { BodyLook } from '../profile/body_look.js';
import { BodySliders } from '../profile/body_sliders.js';
import { ForceOverDepth, usePreview } from '../profile/preview.js';
import { Force, Naming, NeedleFields } from '../profile/sections.js';

const kBlank = {
  id: '',
  name: '',
  axial_model: 'ENHANCED_TRACKING_WALL',
  needle: { length_m: 0.06, gauge: 22, tip: 'HYPODERMIC' },
  limb: { plane: { point_m: { x: 0, y: 0, z: 0 }, normal: { x: 0, y: 0, z: 1 } } },
  layers: [
    {
      tissue: 'SKIN',
      thickness_m: 0.003,
      cutting_force_n: 0.8,
      attracted_force_n: 0.4,
      rejection_force_n: 0.1,
      lateral_stiffness_n_per_m2: 9000,
      friction_n_per_m: 25,
    },
  ],
  tracking_wall: { stiffness_n_per_m: 500, stop_speed_m_s: 0.003, stop_dwell_s: 0.05, stop_duration_s: 0.8 },
  max_force_n: 10,
  targets: [],
  hazards: [],
  effects: ['CUTTING', 'ATTRACTED'],
};

/** The server's check of the document, repeated after a pause in typing; `checked`: it has answered. */
export function useCheck(doc, check) {
  const settled = useDebounced(doc, 300);
  const [state, setState] = useState({ problems: [], checked: false, error: null });
  useEffect(() => {
    if (!settled) return undefined;
    const abort = new AbortController();
    const show = (state) => released().then(() => !abort.signal.aborted && setState(state));
    check(settled, abort.signal).then(
      (problems) => show({ problems, checked: true, error: null }),
      (error) => show((before) => ({ ...before, checked: false, error })),
    );
    return () => abort.abort();
  }, [settled]);
  return state;
}

/**
 * Fields with values that the document cannot hold: `why` nothing can be saved, '' if all is well; `onBad` reports one.
 */
export function useBadFields() {
  const [paths, setPaths] = useState([]);
  const onBad = useCallback(
    (path, bad) =>
      setPaths((all) => (all.includes(path) === bad ? all : bad ? [...all, path] : all.filter((p) => p !== path))),
    [],
  );
  const why = paths.includes('json')
    ? 'The JSON text is not in the document: correct it, or use the form’s text. Until then nothing can be saved.'
    : paths.length > 0
      ? 'A field does not contain one clear number: nothing can be saved.'
      : '';
  return { why, onBad };
}

/** Ctrl+S saves. */
export function useSaveKey(save) {
  // use what was typed last: effects run later than the next key
  const latest = useRef(save);
  latest.current = save;
  useEffect(() => {
    const press = (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.key !== 's') return;
      event.preventDefault();
      latest.current();
    };
    addEventListener('keydown', press);
    return () => removeEventListener('keydown', press);
  }, []);
}

/** Whether there are unsaved changes, and the result of saving; `why`: in words, what prevents it. */
export function SaveBar({ editing, save, what, bad, why, readonly }) {
  if (readonly) return html`<p class="help">Your role can view this, but not change it.</p>`;
  const { saving, dirty, base, restored, discard } = editing;
  return html`<div class="save-bar">
    <${DraftBack} draft=${{ back: restored }} />
    <${Problem} error=${saving.error} title=${`The ${what} was not saved`} />
    ${why && html`<p class="error">✗ ${why}</p>`}
    <div class="actions">
      <button type="button" class="main" disabled=${!dirty || saving.busy || bad || !!why} onClick=${save}>${
        saving.busy ? 'Saving …' : 'Save'
      }</button>
      <${DangerButton}
        text="Discard changes"
        disabled=${!dirty}
        title="Discard all changes?"
        word="Discard"
        act=${discard}
      >
        All changes since the ${what} was last saved are lost.
      <//>
      ${
        dirty
          ? html`<${Mark} kind="warn">not saved yet<//>`
          : base.revision > 0
            ? html`<${Mark} kind="good">revision ${base.revision}<//>`
            : ''
      }
    </div>
  </div>`;
}

/** A part of the form behind its title. */
function More({ title, open = false, children }) {
  return html`<details class="more" open=${open}><summary>${title}</summary>${children}</details>`;
}

export function ProfileEditor({ params, query, person }) {
  const id = params.id ?? '',
    readonly = !may(person.role, 'edit profiles');
  const begin = useCallback(async () => {
    if (!query.from) return kBlank;
    const { json } = await documents('profiles').one(query.from);
    return { ...json, id: `${json.id}-copy`, name: `${json.name} (copy)` };
  }, [query.from]);
  const editing = useDocument('profiles', id, begin);
  const { doc } = editing;
  const { problems, checked, error: unchecked } = useCheck(doc, checkProfile);
  const rendered = usePreview(doc?.volume ? null : doc);
  const [chosen, setChosen] = useState(0);
  const port = useRef({});
  const { why, onBad } = useBadFields();
  const save = async () => {
    if (readonly || why || !editing.dirty) return;
    const saved = await editing.save();
    if (saved?.revision && !id) location.hash = href(['profiles', doc.id]);
  };
  useSaveKey(save);
  /** The changes go to a new profile, and this one stays. */
  const copy = () => {
    const other = { ...doc, id: `${id}-copy`, name: `${doc.name} (copy)` };
    draftOf('profiles/new').write({ base: { revision: 0, json: {} }, value: other });
    editing.discard();
    location.hash = href(['profiles-new'], { from: id });
  };
  const title = id ? (editing.base?.json.name ?? id) : 'New profile';
  const above = html`<a href="#/profiles">Patient profiles</a>`;
  if (!doc)
    return html`
      <${Heading} title=${title} above=${above} />
      ${
        editing.error
          ? html`<${Problem} error=${editing.error} retry=${editing.reload} />`
          : html`<p class="loading" role="status">Loading …</p>`
      }
    `;
  const refused = editing.saving.error?.field
    ? [{ path: editing.saving.error.field, message: editing.saving.error.said, severity: 'ERROR' }]
    : [];
  const all = [...problems, ...refused.filter((r) => !problems.some((p) => p.path === r.path))];
  const change = (next) => editing.change((before) => followLayerNames(before, next(before)));
  const f = formOf({ doc, shape: kProfileShape, change, problems: all, onBad, readonly });
  const profile = f.doc;
  // a profile that is not or cannot be rendered has no fidelity: the last version's belongs to another patient
  const fidelity = rendered.error || rendered.stale ? undefined : rendered.preview?.layers?.map((l) => l.fidelity);
  return html`
    <div class="editor-head">
      <${Heading} title=${title} above=${above}>${
        id &&
        html`<a class="button" href=${href(['profiles', id, 'revisions'])}>Revisions</a>
          ${editing.dirty && !readonly && html`<button type="button" onClick=${copy}>Save as another …</button>`}`
      }<//>
      <${SaveBar} editing=${editing} save=${save} what="profile" why=${why} readonly=${readonly} />
    </div>
    <div class="editor-columns one-screen">
      <aside class="look" tabindex="0" aria-label="What it looks and feels like">
        ${
          profile.volume
            ? html`<${BodyLook} f=${f} whole=${doc} of=${[id, query.from]} choose=${setChosen} port=${port} />`
            : html`<section>
                  <${SideView}
                    profile=${profile}
                    fidelity=${fidelity}
                    height_px=${290}
                    label=${`Side view of ${counted(profile.layers?.length ?? 0, 'layer')}, ${quantity(
                      layerBounds(profile).at(-1)?.to_m ?? 0,
                      'm',
                    )} deep in total`}
                  />
                  <${Legend} profile=${profile} />
                  <p class="help">
                    φ: how much of the step in force into a layer can be felt, 0 to 1; “!” below 0.5.
                  </p>
                </section>
                <${ForceOverDepth} ...${rendered} height=${170} />`
        }
      </aside>
      <form onSubmit=${(event) => event.preventDefault()} aria-label="Profile">
        <${More} title="Patient" open=${!id}><${Naming} f=${f} is_new=${!id} /><//>
        ${
          profile.volume &&
          html`<${BodySliders}
          key=${editing.turn}
          whole=${doc}
          change=${editing.change}
          port=${port}
          readonly=${readonly}
        />`
        }
        ${
          profile.volume
            ? html`<${Structures} f=${f} chosen=${chosen} choose=${setChosen} />`
            : html`<${Layers} f=${f} />`
        }
        <${More} title="Needle"><${NeedleFields} f=${f} /><//>
        ${!profile.volume && html`<${More} title="Limb"><${LimbFields} f=${f} /><//>`}
        <${More} title="Targets"><${Targets} f=${f} /><//>
        <${More} title="Hazards"><${Hazards} f=${f} /><//>
        <${More} title="Directions"><${DirectionFields} f=${f} /><//>
        <${More} title="Force"><${Force} f=${f} /><//>
        <${AsJson} whole=${doc} change=${editing.change} onBad=${onBad} turn=${editing.turn} readonly=${readonly} />
        <div class="checked">
          ${(checked || f.problems.length > 0) && html`<${ProblemList} problems=${f.problems} />`}
          ${!checked && unchecked && !readonly && html`<p class="warning">! Not checked: ${unchecked.message}</p>`}
          ${
            f.problems.some((p) => p.severity === 'ERROR') &&
            html`<p class="help">The server will refuse this profile until these are fixed.</p>`
          }
        </div>
      </form>
    </div>
    ${
      editing.conflict &&
      html`<${ConflictDialog} conflict=${editing.conflict} settle=${editing.settle} close=${editing.closeConflict} />`
    }
  `;
}

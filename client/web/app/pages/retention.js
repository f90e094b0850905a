// How long recordings are kept: for ever, unless a policy is set. Scores, events and remarks always stay.
import { may } from '../lib/roles.js';
import { moment } from '../lib/time.js';
import { bytes, number } from '../lib/units.js';
import { exercises, lab, retention } from '../net/requests.js';
import { announce, Confirm, DangerButton, Empty, Heading, Loaded, Mark, Problem, Table } from '../ui/widgets.js';
import { CheckField, NumberField, SelectField } from '../ui/fields.js';
import { DraftBack, draftOf, useDraft } from '../ui/draft.js';
import { useAction, useExerciseName, useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';

const days = (n) => `${number(n, 6)} ${n === 1 ? 'day' : 'days'}`;
const isSet = (v) => v !== undefined && v !== null;
function thinWords(p) {
  if (!isSet(p.thin_after_days)) return 'never';
  const coarser = p.thin_coarser > 1 ? `, steps ${number(p.thin_coarser, 4)} times as coarse` : '';
  return `after ${days(p.thin_after_days)}: to ${number(p.thin_rate_hz, 4)} samples a second${coarser}`;
}
const kGreatest = { thin_after_days: 36500, thin_rate_hz: 10_000, thin_coarser: 1000, delete_after_days: 36500 };
const kBlank = { exercise_id: '', without_backup: false };

/** Faults that the server would refuse, found before asking it. */
function faultsOf(p) {
  const faults = [];
  const say = (path, message) => faults.push({ path, message });
  const whole = (path) =>
    isSet(p[path]) &&
    !(Number.isInteger(p[path]) && p[path] >= 0 && p[path] <= kGreatest[path]) &&
    say(path, `whole days, at most ${kGreatest[path]}`);
  whole('thin_after_days');
  whole('delete_after_days');
  if (isSet(p.thin_after_days) && !(p.thin_rate_hz >= 0.1 && p.thin_rate_hz <= kGreatest.thin_rate_hz))
    say('thin_rate_hz', 'how many samples a second are left: 0.1 to 10000');
  if (isSet(p.thin_coarser) && !(p.thin_coarser >= 1 && p.thin_coarser <= kGreatest.thin_coarser))
    say('thin_coarser', '1 to 1000');
  if (isSet(p.thin_after_days) && isSet(p.delete_after_days) && p.delete_after_days <= p.thin_after_days)
    say('delete_after_days', 'later than the thinning');
  return faults;
}

function PolicyForm({ begin, known, done }) {
  const nameOf = (id) => known.find((e) => e.id === id)?.name ?? id;
  const [policy, setPolicy, draft] = useDraft('policy', begin);
  const [bad, setBad] = useState([]);
  const action = useAction();
  const set = (key) => (value) => setPolicy((before) => ({ ...before, [key]: value }));
  const onBad = (path, is) =>
    setBad((all) => (all.includes(path) === is ? all : is ? [...all, path] : all.filter((p) => p !== path)));
  const faults = faultsOf(policy);
  const refused = action.error?.field
    ? [{ path: action.error.field.replace(/^policy\./, ''), message: action.error.said }]
    : [];
  const field = (key, label, unit, help) =>
    html`<${NumberField}
      label=${label}
      unit=${unit}
      most=${kGreatest[key]}
      whole=${key.endsWith('_days')}
      path=${key}
      value=${policy[key]}
      problems=${[...faults, ...refused]}
      onValue=${set(key)}
      onBad=${onBad}
      help=${help}
    />`;
  const save = async (event) => {
    event.preventDefault();
    const { exercise_id, thin_after_days, thin_rate_hz, thin_coarser, delete_after_days, without_backup } = policy;
    const thin = isSet(thin_after_days)
      ? { thin_after_days, thin_rate_hz, ...(isSet(thin_coarser) ? { thin_coarser } : {}) }
      : {};
    if (
      !(await action.run(() =>
        retention.put({
          exercise_id,
          without_backup,
          ...thin,
          ...(isSet(delete_after_days) ? { delete_after_days } : {}),
        }),
      ))
    )
      return;
    draft.drop();
    announce(`Retention of ${exercise_id ? nameOf(exercise_id) : 'all other exercises'} was saved.`);
    done();
  };
  return html`<form onSubmit=${save} aria-label="Policy">
    <fieldset>
      <legend>Set a policy</legend>
      <${DraftBack} draft=${draft} />
      <${SelectField}
        label="Exercise"
        value=${policy.exercise_id}
        onValue=${set('exercise_id')}
        options=${[['', 'All without their own policy'], ...known.map((e) => [e.id, e.name])]}
      />
      <div class="fields">
        ${field('thin_after_days', 'Thin out after', 'days', 'empty: never')}
        ${field('thin_rate_hz', 'Samples left', 'a second', 'about')}
        ${field('thin_coarser', 'Coarser steps', 'times', 'empty: as recorded')}
        ${field('delete_after_days', 'Delete after', 'days', 'empty: never')}
      </div>
      <${CheckField}
        label="Also recordings that no verified backup has"
        checked=${policy.without_backup}
        onValue=${set('without_backup')}
        help="Otherwise a session waits for the next backup."
      />
      <${Problem} error=${refused.length ? null : action.error} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy || faults.length + bad.length > 0}>
          Save the policy
        </button>
      </div>
    </fieldset>
  </form>`;
}

function Run({ done }) {
  const nameOf = useExerciseName();
  const [report, setReport] = useState(null);
  const [asking, setAsking] = useState(false);
  const action = useAction();
  const run = async (dry_run) => {
    setReport(null);
    const reply = await action.run(() => retention.run(dry_run));
    setAsking(false);
    if (!reply) return;
    setReport(reply);
    if (!dry_run) done();
  };
  const steps = report?.steps ?? [];
  return html`<fieldset>
    <legend>Run</legend>
    <p>
      The server does this by itself once a day. What has been thinned or deleted can only come back from a backup.
    </p>
    <div class="actions">
      <button type="button" disabled=${action.busy} onClick=${() => run(true)}>${
        action.busy ? 'Looking …' : 'Show what would happen'
      }</button>
      <button
        type="button"
        class="danger"
        disabled=${action.busy || !report?.dry_run || report.thinned + report.deleted === 0}
        onClick=${() => setAsking(true)}
      >
        Run now …
      </button>
    </div>
    <${Problem} error=${action.error} />
    <div role="status">${
      report &&
      html`<p>
        <${Mark} kind=${report.dry_run ? 'info' : 'good'}>${report.dry_run ? 'would happen' : 'done'}<//>
        ${` ${report.thinned} thinned, ${report.deleted} deleted, ${report.waiting_for_backup} wait for a backup, `}
        ${`${report.left_alone} left alone; ${bytes(report.bytes_before)} become ${bytes(report.bytes_after)}.`}
      </p>`
    }</div>
    ${
      steps.length > 0 &&
      html`<${Table} caption="Session by session" head=${['Session', 'Exercise', 'What', 'Why']}>${steps.map(
        (s, i) =>
          html`<tr key=${s.session_id}>
            <th scope="row"><a href=${`#/sessions/${s.session_id}`}>Session ${i + 1}</a></th>
            <td>${nameOf(s.exercise_id)}</td>
            <td>${s.action.toLowerCase().replaceAll('_', ' ')}</td>
            <td class="long">${s.text}</td>
          </tr>`,
      )}<//>`
    }
    ${
      asking &&
      html`<${Confirm}
        title="Thin out and delete now?"
        word="Run now"
        act=${() => run(false)}
        close=${() => setAsking(false)}
        busy=${action.busy}
      >
        <p>
          ${report?.thinned ?? 0} recordings are thinned out, ${report?.deleted ?? 0} deleted. Scores, events and
          remarks stay.
        </p>
      <//>`
    }
  </fieldset>`;
}

/** What an erasure does with recordings. */
function OfErasedPeople() {
  const load = useLoad((signal) => lab.settings(signal), []);
  const action = useAction();
  const set = async (keep_recordings_of_erased) => {
    const settings = await action.run(() => lab.change({ keep_recordings_of_erased }));
    if (!settings) return;
    load.setData(settings);
    announce(
      keep_recordings_of_erased
        ? 'Sessions of erased people are now kept.'
        : 'Sessions of erased people are now deleted.',
    );
  };
  return html`<fieldset>
    <legend>When a person is erased</legend>
    <${Loaded} load=${load}>${(settings) =>
      html`<${CheckField}
        label="Sessions stay, without a name"
        checked=${settings.keep_recordings_of_erased}
        disabled=${action.busy}
        onValue=${set}
        help="Otherwise recordings, scores and events are deleted with the person. Remarks and titles stay in any case."
      />`}<//>
    <${Problem} error=${action.error} />
  </fieldset>`;
}

export function RetentionPage({ person: me }) {
  const load = useLoad(async (signal) => {
    const [state, known] = await Promise.all([retention.all(signal), exercises(signal)]);
    return { state, known };
  }, []);
  const [begin, setBegin] = useState(kBlank);
  const action = useAction();
  const drop = async (policy) => {
    if (!(await action.run(() => retention.drop(policy.exercise_id)))) return;
    announce(`The policy of ${policy.name} was removed.`);
    load.reload();
  };
  return html`
    <${Heading} title="Retention" />
    <${Loaded} load=${load}>${({ state, known }) => {
      const policies = state.policies ?? [],
        nameOf = (id) => (id ? (known.find((e) => e.id === id)?.name ?? id) : 'All other exercises');
      return html`
        <dl class="facts">
          <dt>Database</dt>
          <dd>${bytes(state.database_bytes)}, ${bytes(state.free_bytes)} of it free</dd>
          <dt>So far</dt>
          <dd>${state.thinned_sessions} thinned, ${state.deleted_sessions} deleted</dd>
          <dt>Last run</dt>
          <dd>${state.last_run_unix_ms ? moment(state.last_run_unix_ms) : 'never'}</dd>
        </dl>
        ${
          policies.length === 0
            ? html`<${Empty} title="No policy is set: all recordings are kept in full">
                Set a policy below; scores, events and remarks stay in any case.
              <//>`
            : html`<${Table}
                caption="Policies"
                head=${[
                  'Exercise',
                  'Thinned',
                  'Deleted',
                  'Without a backup',
                  'Set by',
                  html`<span class="visually-hidden">Actions</span>`,
                ]}
              >${policies.map(
                (p) => html`<tr key=${p.exercise_id}>
                  <th scope="row">${nameOf(p.exercise_id)}</th>
                  <td>${thinWords(p)}</td>
                  <td>${isSet(p.delete_after_days) ? `after ${days(p.delete_after_days)}` : 'never'}</td>
                  <td>${p.without_backup ? html`<${Mark} kind="warn">also<//>` : 'waits'}</td>
                  <td>${p.by}, ${moment(p.changed_unix_ms)}</td>
                  <td>
                    <div class="actions">
                      <button
                        type="button"
                        class="small"
                        aria-label=${`Change the policy of ${nameOf(p.exercise_id)}`}
                        onClick=${() => {
                          draftOf('policy').drop();
                          setBegin({ ...p });
                        }}
                      >
                        Change
                      </button>
                      <${DangerButton}
                        small
                        text="Remove"
                        disabled=${action.busy}
                        label=${`Remove the policy of ${nameOf(p.exercise_id)}`}
                        title="Remove the policy?"
                        act=${() => drop({ ...p, name: nameOf(p.exercise_id) })}
                      >
                        ${nameOf(p.exercise_id)}: ${
                          p.exercise_id
                            ? 'the policy of all other exercises then applies; without one, recordings are kept in full.'
                            : 'recordings without their own policy are then kept in full.'
                        }
                      <//>
                    </div>
                  </td>
                </tr>`,
              )}<//>`
        }
        <${Problem} error=${action.error} />
        <${PolicyForm}
          key=${begin.exercise_id + (begin.changed_unix_ms ?? '')}
          begin=${begin}
          known=${known}
          done=${() => {
            setBegin(kBlank);
            load.reload();
          }}
        />
        <${Run} done=${load.reload} />
        ${may(me.role, 'erase person') && html`<${OfErasedPeople} />`}
      `;
    }}<//>
  `;
}

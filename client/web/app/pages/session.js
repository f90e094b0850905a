// One session: verdict and replay first, then score, plots, remarks, syringe, and what is known of the session.
import { kExportFormats } from '../lib/export_formats.js';
import { advance, atRest, columnsOf, contactsOf, loaded, seek, toggle } from '../lib/recording.js';
import { href } from '../lib/routes.js';
import { moment } from '../lib/time.js';
import { counted, words } from '../lib/units.js';
import { address } from '../net/api.js';
import { sessions } from '../net/requests.js';
import { traineeName } from '../lib/lab.js';
import { may } from '../lib/roles.js';
import { useExerciseName, useLoad } from '../ui/hooks.js';
import { html, useEffect, useMemo, useState } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, Problem } from '../ui/widgets.js';
import { Excuse } from '../session/excuse.js';
import { Annotations, SyringeEvents } from '../session/notes.js';
import { Plots } from '../session/plots.js';
import { Replay } from '../session/replay.js';
import { Judgement, Score, useScore } from '../session/score.js';
import { whyItWaits } from './sessions.js';

const kPoints = 2000;

/** Why the session waits for a manager, with the trainee. */
function waitingFor(session) {
  const trainee = traineeName(session.description);
  if (session.not_assigned) return `it was not assigned to ${trainee} when the session arrived`;
  if (session.code_unchecked) return `the code of ${trainee} was not given`;
  return session.begin_unsure
    ? 'the station’s clock was wrong'
    : `no one was named ${trainee} when the session arrived`;
}

/** A replay driven by the browser's animation frames. */
function usePlayback(from_s, to_s) {
  const [playback, setPlayback] = useState(atRest(from_s, to_s));
  useEffect(() => setPlayback((p) => loaded(p, from_s, to_s)), [from_s, to_s]);
  useEffect(() => {
    if (!playback.playing) return undefined;
    let frame = 0,
      before = performance.now();
    const step = (now) => {
      setPlayback((p) => advance(p, (now - before) / 1000));
      before = now;
      frame = requestAnimationFrame(step);
    };
    frame = requestAnimationFrame(step);
    return () => cancelAnimationFrame(frame);
  }, [playback.playing]);
  const act = useMemo(
    () => ({
      toggle: () => setPlayback(toggle),
      seek: (at_s) => setPlayback((p) => seek(p, at_s)),
      speed: (speed) => setPlayback((p) => ({ ...p, speed })),
    }),
    [],
  );
  return [playback, act];
}

/** @param {{id: string, session: any, measures: any[]|undefined, person: any, score: any}} props `score`: drawn below the replay */
function Recording({ id, session, measures, person, score }) {
  const [window, zoom] = useState(null);
  const whole = useLoad((signal) => sessions.samples(id, { points: kPoints }, signal), [id]);
  const near = useLoad(
    (signal) => (window ? sessions.samples(id, { ...window, points: kPoints }, signal) : Promise.resolve(null)),
    [id, window],
  );
  const notes = useLoad((signal) => sessions.annotations(id, signal), [id]);
  const columns = useMemo(() => columnsOf(whole.data), [whole.data]);
  const shown = useMemo(() => (window && near.data ? columnsOf(near.data) : columns), [window, near.data, columns]);
  const t = columns.t_s ?? [];
  const [playback, act] = usePlayback(t[0] ?? 0, t.at(-1) ?? 0);
  const { profile, placement } = session.description;
  const contacts = useMemo(() => contactsOf(columns, profile, placement), [columns, profile, placement]);
  const marks = useMemo(
    () => [
      ...contacts.flatMap(({ name, moments_s }) => moments_s.map((x) => ({ x, label: name }))),
      ...(notes.data ?? []).map((a) => ({ x: a.t_s, label: a.text })),
    ],
    [contacts, notes.data],
  );
  return html`
    <${Loaded} load=${whole}>${() =>
      t.length === 0
        ? html`<${Empty} title="There are no samples">The recording is empty, or has been deleted by retention.<//>`
        : html`<section aria-labelledby="replay-title">
            <h2 id="replay-title">Replay</h2>
            ${
              profile
                ? html`<${Replay}
                    columns=${columns}
                    session=${session}
                    contacts=${contacts}
                    measures=${measures}
                    playback=${playback}
                    act=${act}
                  />`
                : html`<p class="help">Without its profile the session cannot be drawn.</p>`
            }
          </section>`}<//>
    ${score}
    ${
      t.length > 0 &&
      html`<section aria-labelledby="plots-title">
        <h2 id="plots-title">Plots</h2>
        <${Problem} error=${near.error} />
        <${Plots}
          columns=${shown}
          profile=${profile}
          requirements=${measures}
          marks=${marks}
          at=${playback.at_s}
          seek=${act.seek}
          window=${window}
          zoom=${zoom}
          busy=${near.loading && !!window}
        />
      </section>`
    }
    <${Annotations} id=${id} at_s=${playback.at_s} seek=${act.seek} load=${notes} person=${person} />
    <${SyringeEvents} id=${id} seek=${act.seek} />
  `;
}

/** The part of an exam's recording that is shown before its results. */
function Remarks({ id, person }) {
  const notes = useLoad((signal) => sessions.annotations(id, signal), [id]);
  return html`<${Annotations} id=${id} at_s=${0} load=${notes} person=${person} />`;
}

/** Verdict, recording and score: the plots draw the limits of the same score. */
function Judged({ id, session, exercise, person }) {
  const load = useScore(session);
  const score = html`<${Score} session=${session} exercise=${exercise} load=${load} person=${person} />`;
  return html`
    <${Judgement} session=${session} load=${load} />
    ${
      session.results_from_unix_ms
        ? html`
            ${score}
            <${Remarks} id=${id} person=${person} />
          `
        : html`<${Recording} id=${id} session=${session} measures=${load.data?.score?.measures} person=${person} score=${score} />`
    }
  `;
}

/** The attempt's number, and whether it counts. */
function AttemptFact({ description, person }) {
  const load = useLoad((signal) => sessions.attempt(description.session_id, signal), [description.session_id]);
  return html`<${Loaded} load=${load}>${(attempt) =>
    !attempt
      ? html`<span>this session is not an attempt</span>`
      : html`
          number ${attempt.number}
          ${attempt.excused && html`<${Mark} kind="info">${attempt.beyond ? 'beyond the limit' : 'does not count'}<//>`}
          ${attempt.late && html`<${Mark} kind="warn">late<//>`} ${
            may(person.role, 'excuse') && !attempt.beyond && html`<${Excuse} attempt=${attempt} done=${load.reload} />`
          }
        `}<//>`;
}

export function SessionPage({ params, person }) {
  const { id } = params;
  const load = useLoad((signal) => sessions.one(id, signal), [id]);
  const nameOf = useExerciseName();
  const d = load.data?.description;
  // a profile that is not readable has no name
  const patient = d?.profile?.name || d?.profile_id;
  return html`
    <${Heading}
      title=${d ? `${traineeName(d)}: ${nameOf(d.exercise_id)}` : 'Session'}
      above=${html`<a href="#/sessions">Sessions</a>`}
    >${
      load.data &&
      !load.data.results_from_unix_ms &&
      kExportFormats.samples.map(
        (f) =>
          html`<a class="button" href=${address(['sessions', id, `samples${f.suffix}`])} download>Samples as ${f.title}</a>`,
      )
    }<//>
    <${Loaded} load=${load}>${(session) => html`
      <${Judged} id=${id} session=${session} exercise=${nameOf(d.exercise_id)} person=${person} />
      <h2>Session</h2>
      <dl class="facts">
        <dt>Begun</dt>
        <dd>${moment(d.started_unix_ms)}, ${d.station}</dd>
        ${
          session.unknown_trainee &&
          html`<dt>Trainee</dt>
            <dd>
              <${Mark} kind="warn">${whyItWaits(session)[0]}<//> ${waitingFor(session)}
            </dd>`
        }
        ${
          session.given_trainee &&
          html`<dt>Trainee</dt>
            <dd>${traineeName(d)}; the station named ${session.given_trainee}, a manager ${
              session.given_trainee === d.trainee ? 'confirmed' : 'assigned'
            } it</dd>`
        }
        ${
          session.quarantined_chunks > 0 &&
          html`<dt>Damage</dt>
            <dd>
              <${Mark} kind="bad">damaged<//> ${counted(session.quarantined_chunks, 'chunk')} cannot be decoded: kept as
              sent, left out of pictures and score
            </dd>`
        }
        <dt>Recording</dt>
        <dd>${counted(session.samples, 'sample')} at ${d.rate_hz} Hz</dd>
        <dt>Patient</dt>
        <dd>
          ${
            may(person.role, 'see profiles')
              ? html`<a href=${href(['profiles', d.profile_id])}>${patient}</a>`
              : patient
          },
          revision ${d.profile_revision}
        </dd>
        <dt>State</dt>
        <dd>${words(String(session.state).replace('SESSION_', ''))}, engine <span class="long">${d.engine_version}</span>, ${d.device}</dd>
        ${
          d.exercise_id &&
          html`<dt>Attempt</dt><dd class="actions"><${AttemptFact} description=${d} person=${person} /></dd>`
        }
        <dt>More</dt>
        <dd><a href=${href(['progress', d.trainee], { exercise: d.exercise_id })}>Progress over attempts</a></dd>
      </dl>
    `}<//>
  `;
}

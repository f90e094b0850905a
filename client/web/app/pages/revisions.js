// The differences of two revisions of a profile or course.
import { changes } from '../lib/diff.js';
import { placeWords, valueWords } from '../lib/plain_words.js';
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { moment } from '../lib/time.js';
import { counted } from '../lib/units.js';
import { documents } from '../net/requests.js';
import { announce, Empty, Heading, Loaded, Mark, Problem, Table } from '../ui/widgets.js';
import { SelectField } from '../ui/fields.js';
import { useAction, useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';

function Differences({ kind, id, from, to }) {
  const load = useLoad(
    async (signal) => {
      const [before, after] = await Promise.all([
        documents(kind).one(id, from, signal),
        documents(kind).one(id, to, signal),
      ]);
      return changes(before.json, after.json);
    },
    [kind, id, from, to],
  );
  return html`<${Loaded} load=${load}>${(all) =>
    all.length === 0
      ? html`<${Empty} title="No difference">Revisions ${from} and ${to} are the same.<//>`
      : html`<${Table}
          caption=${`${counted(all.length, 'change')} from revision ${from} to ${to}`}
          head=${['Field', 'What', `Revision ${from}`, `Revision ${to}`]}
        >${all.map(
          (c) => html`<tr key=${c.path}>
            <th scope="row">${placeWords(c.path)}</th>
            <td>${
              c.before === undefined
                ? html`<${Mark} kind="good">added<//>`
                : c.after === undefined
                  ? html`<${Mark} kind="bad">removed<//>`
                  : html`<${Mark} kind="warn">changed<//>`
            }</td>
            <td class="long">${valueWords(c.before, c.path)}</td>
            <td class="long">${valueWords(c.after, c.path)}</td>
          </tr>`,
        )}<//>`}<//>`;
}

const page = (kind, what, edit) =>
  function RevisionsPage({ params, query, person }) {
    const { id } = params;
    const load = useLoad((signal) => documents(kind).revisions(id, signal), [id]);
    const action = useAction();
    const restore = async (all, revision) => {
      const done = await action.run(async () => {
        const old = await documents(kind).one(id, revision);
        return documents(kind).put(id, old.json, all[0].revision);
      });
      if (!done) return;
      announce(`Revision ${revision} was saved again, as revision ${done.revision}.`);
      load.reload();
    };
    return html`
      <${Heading}
        title=${`Revisions of ${load.data?.[0]?.name ?? id}`}
        above=${html`<a href=${href([kind, id])}>Back to the ${what}</a>`}
      />
      <${Loaded} load=${load}>${(all) => {
        const to = query.to ?? String(all[0].revision),
          from = query.from ?? String(all[1]?.revision ?? all[0].revision);
        const options = all.map((r) => [
          String(r.revision),
          `${r.revision}: ${moment(r.created_unix_ms)}, ${r.author}`,
        ]);
        const go = (key) => (value) => {
          location.hash = href([kind, id, 'revisions'], { from, to, [key]: value });
        };
        return html`
          <${Table}
            caption="All revisions; none is ever overwritten"
            head=${['Revision', 'Name', 'Saved', 'By', html`<span class="visually-hidden">Actions</span>`]}
          >${all.map(
            (r, i) => html`<tr key=${r.revision}>
              <th scope="row">${r.revision}</th>
              <td>${r.name}</td>
              <td>${moment(r.created_unix_ms)}</td>
              <td>${r.author}</td>
              <td>
                <div class="actions">
                  ${
                    i < all.length - 1 &&
                    html`<a
                      href=${href([kind, id, 'revisions'], { from: all[i + 1].revision, to: r.revision })}
                      aria-label=${`What changed in revision ${r.revision}`}
                    >
                      What changed
                    </a>`
                  }
                  ${
                    i > 0 &&
                    may(person.role, edit) &&
                    html`<button
                      type="button"
                      class="small"
                      disabled=${action.busy}
                      aria-label=${`Save as the newest: revision ${r.revision}`}
                      onClick=${() => restore(all, r.revision)}
                    >
                      Save as the newest
                    </button>`
                  }
                </div>
              </td>
            </tr>`,
          )}<//>
          <${Problem} error=${action.error} />
          <h2>Compare</h2>
          <div class="filters">
            <${SelectField} label="From" value=${from} options=${options} onValue=${go('from')} />
            <${SelectField} label="To" value=${to} options=${options} onValue=${go('to')} />
          </div>
          <${Differences} kind=${kind} id=${id} from=${from} to=${to} />
        `;
      }}<//>
    `;
  };

export const ProfileRevisions = page('profiles', 'profile', 'edit profiles');
export const CourseRevisions = page('courses', 'course', 'edit courses');

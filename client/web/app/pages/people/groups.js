// Groups and their members.
import { merge, resolved } from '../../lib/diff.js';
import { may } from '../../lib/roles.js';
import { href } from '../../lib/routes.js';
import { counted, shownOf } from '../../lib/units.js';
import { groups, people } from '../../net/requests.js';
import {
  announce,
  DangerButton,
  Dialog,
  Empty,
  Heading,
  Loaded,
  number,
  Problem,
  Table,
  usePages,
} from '../../ui/widgets.js';
import { ConflictDialog } from '../../ui/conflict.js';
import { CheckField, TextField } from '../../ui/fields.js';
import { DraftBack, useDraft } from '../../ui/draft.js';
import { useAction, useDebounced, useLoad } from '../../ui/hooks.js';
import { html, useState } from '../../ui/html.js';

/** How many members are drawn before a person asks for more. */
const kShownMembers = 100;

function AddGroup({ close }) {
  const [entry, setEntry, draft] = useDraft('group', { id: '', name: '' });
  const action = useAction();
  const problems = action.error?.field ? [{ path: action.error.field, message: action.error.said }] : [];
  const cancel = () => {
    draft.drop();
    close();
  };
  const save = async (event) => {
    event.preventDefault();
    if (!(await action.run(() => groups.add({ ...entry, members: [] })))) return;
    draft.drop();
    location.hash = href(['groups', entry.id]);
  };
  return html`<${Dialog} title="Add a group" close=${close}>
    <form onSubmit=${save}>
      <${TextField}
        label="Id"
        path="id"
        problems=${problems}
        value=${entry.id}
        onValue=${(id) => setEntry({ ...entry, id })}
        help="short, for files and CSV: letters, digits, '-', '_', '.'"
        required
        pattern="[A-Za-z0-9._\\-]{1,64}"
      />
      <${TextField}
        label="Name"
        path="name"
        problems=${problems}
        value=${entry.name}
        onValue=${(name) => setEntry({ ...entry, name })}
        required
      />
      <${Problem} error=${problems.length ? null : action.error} />
      <${DraftBack} draft=${draft} />
      <div class="actions">
        <button type="submit" class="main" disabled=${action.busy}>Add</button>
        <button type="button" onClick=${cancel}>Cancel</button>
      </div>
    </form>
  <//>`;
}

export function GroupsPage({ person }) {
  const [text, setText] = useState('');
  const search = useDebounced(text.trim(), 300);
  const pages = usePages((page, signal) => groups.page({ search, page }, signal), [search]);
  const [adding, setAdding] = useState(false);
  const edit = may(person.role, 'edit people');
  return html`
    <${Heading} title="Groups">${
      edit && html`<button type="button" class="main" onClick=${() => setAdding(true)}>Add a group</button>`
    }<//>
    <form class="filters" role="search" aria-label="Groups" onSubmit=${(event) => event.preventDefault()}>
      <${TextField} label="Find" type="search" value=${text} onValue=${setText} maxlength="64" />
    </form>
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? search
          ? html`<${Empty} title="No group matches">Change the search above.<//>`
          : html`<${Empty} title="There are no groups yet">Add one, or import people with a column “group”.<//>`
        : html`<${Table} caption="Groups" head=${['Group', 'Id', number('Members'), 'Results']}>${pages.items.map(
            (g) => html`<tr key=${g.id}>
              <th scope="row"><a href=${href(['groups', g.id])}>${g.name}</a></th>
              <td>${g.id}</td>
              <td class="number">${g.member_count}</td>
              <td><a href=${href(['results'], { group: g.id })}>Results of ${g.name}</a></td>
            </tr>`,
          )}<//>${pages.button}`}<//>
    ${adding && html`<${AddGroup} close=${() => setAdding(false)} />`}
  `;
}

/** The trainees that match the typed text, a page at a time; each is a member or not. */
function Candidates({ members, toggle }) {
  const [text, setText] = useState('');
  const search = useDebounced(text.trim(), 300);
  const pages = usePages((page, signal) => people.page({ search, role: 'trainee', limit: 50, page }, signal), [search]);
  return html`
    <${TextField}
      label="Find a trainee"
      type="search"
      value=${text}
      onValue=${setText}
      maxlength="64"
      help="part of a name or group"
    />
    <${Loaded} load=${pages.load}>${() => html`
      <p class="help" role="status">${
        pages.items.length ? shownOf(pages.items.length, pages.first?.total, 'trainee') : 'No trainee matches'
      }</p>
      <div class="choices" role="group" aria-label="Trainees">${pages.items.map(
        (p) =>
          html`<${CheckField}
            key=${p.name}
            label=${`${p.full_name || p.name} (${p.name})`}
            checked=${members.includes(p.name)}
            onValue=${toggle(p.name)}
          />`,
      )}</div>
      ${pages.button}
    `}<//>
  `;
}

/** Present members, and those who were members when the page was loaded. */
function Present({ names, members, toggle }) {
  const [shown, setShown] = useState(kShownMembers);
  if (names.length === 0) return html`<p class="help">No one yet: choose trainees below.</p>`;
  return html`
    <div class="choices" role="group" aria-label="Present members">${names
      .slice(0, shown)
      .map(
        (name) =>
          html`<${CheckField} key=${name} label=${name} checked=${members.includes(name)} onValue=${toggle(name)} />`,
      )}</div>
    ${
      names.length > shown &&
      html`<p>
        <button type="button" onClick=${() => setShown(shown + kShownMembers)}>Show more members</button>
      </p>`
    }
  `;
}

function Members({ group, load, edit }) {
  const begin = { name: group.name, members: [...group.members].sort() };
  const [{ name, members }, setEntry, draft] = useDraft(`group/${group.id}`, begin, group);
  const { base } = draft;
  const [conflict, setConflict] = useState(null);
  const action = useAction();
  const put = async (mine, from) => {
    try {
      await groups.put({ ...mine, id: group.id, revision: from.revision });
    } catch (error) {
      if (error.kind !== 'conflict') throw error;
      const theirs = await groups.one(group.id),
        what = (g) => ({ name: g.name, members: [...g.members].sort() });
      setConflict({ theirs: { ...theirs, author: theirs.changed_by }, ...merge(what(from), what(mine), what(theirs)) });
      return;
    }
    draft.drop();
    announce(`${mine.name} was saved: ${counted(mine.members.length, 'member')}.`);
    load.reload();
  };
  const save = () => action.run(() => put({ name, members }, base));
  const settle = (choice, and_save) => {
    const both = resolved(conflict.merged, conflict.clashes, choice),
      theirs = conflict.theirs;
    setConflict(null);
    draft.rebase(theirs);
    setEntry(both);
    return and_save ? action.run(() => put(both, theirs)) : undefined;
  };
  const drop = async () => {
    await groups.remove(group);
    draft.drop();
    announce(`${group.name} was removed.`);
    location.hash = '#/groups';
  };
  const toggle = (who) => (on) =>
    setEntry({ name, members: on ? [...members, who].sort() : members.filter((m) => m !== who) });
  if (!edit)
    return html`
      <p>${counted(group.members.length, 'member')}</p>
      <ul>${group.members.map((m) => html`<li><a href=${href(['people', m])}>${m}</a></li>`)}</ul>
    `;
  return html`<form
    onSubmit=${(event) => {
      event.preventDefault();
      save();
    }}
  >
    <${DraftBack} draft=${draft} />
    <${TextField} label="Name" value=${name} onValue=${(text) => setEntry({ name: text, members })} required />
    <fieldset>
      <legend>Members: ${members.length}</legend>
      <${Present} names=${[...new Set([...base.members, ...members])].sort()} members=${members} toggle=${toggle} />
      <${Candidates} members=${members} toggle=${toggle} />
    </fieldset>
    <${Problem} error=${action.error} />
    ${conflict && html`<${ConflictDialog} conflict=${conflict} settle=${settle} close=${() => setConflict(null)} />`}
    <div class="actions">
      <button type="submit" class="main" disabled=${action.busy}>Save</button>
      <${DangerButton} text="Remove the group" title=${`Remove ${group.name}?`} word="Remove" act=${drop}>
        Its assignments go with it. The people and their results stay.
      <//>
    </div>
  </form>`;
}

export function GroupPage({ params, person }) {
  const load = useLoad((signal) => groups.one(params.id, signal), [params.id]);
  return html`
    <${Heading} title=${load.data?.name ?? params.id} above=${html`<a href="#/groups">Groups</a>`} />
    <${Loaded} load=${load}>${(group) => html`
      <p><a href=${href(['results'], { group: group.id })}>Results of this group</a></p>
      <${Members}
        key=${group.revision}
        group=${group}
        load=${load}
        edit=${may(person.role, 'edit people')}
      />
    `}<//>
  `;
}

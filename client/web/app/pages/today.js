// A list behind a number of Home: who has something due, who is behind, who struggles.
import { href } from '../lib/routes.js';
import { rowTitle } from '../lib/measures.js';
import { day } from '../lib/time.js';
import { shownOf } from '../lib/units.js';
import { measures, today } from '../net/requests.js';
import { useExerciseName, useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';
import { Empty, Heading, Loaded, Table, usePages } from '../ui/widgets.js';

/** By the word of the address: title, what the list has, the heads of its columns. */
const kLists = {
  due: ['Due this week', 'Assigned, not done, and due within seven days.', ['Trainee', 'Due', 'Exercises']],
  behind: ['Behind', 'Assigned, not done, and the date is over.', ['Trainee', 'Was due', 'Exercises']],
  struggling: [
    'Struggling',
    'Not passed, tried within four weeks, and the last three attempts failed the same requirement.',
    ['Trainee', 'Exercise', 'Failed three times'],
  ],
};

export function TodayPage({ params }) {
  const list = kLists[params.list] ? params.list : 'due';
  const [title, explained, head] = kLists[list];
  const pages = usePages((page, signal) => today(list, page, signal), [list]);
  const kinds = useLoad((signal) => measures(signal), []).data ?? [];
  const nameOf = useExerciseName();
  return html`
    <${Heading} title=${title} above=${html`<a href="#/">Home</a>`} />
    <p>${explained}</p>
    <${Loaded} load=${pages.load}>${() =>
      pages.items.length === 0
        ? html`<${Empty} title="No one" />`
        : html`
            <${Table} caption=${shownOf(pages.items.length, pages.first?.[list], list === 'struggling' ? 'exercise' : 'trainee')} head=${head}>${pages.items.map(
              (row) => html`<tr key=${`${row.trainee} ${row.exercise_ids[0]}`}>
                <th scope="row">
                  <a href=${href(['progress', row.trainee], { exercise: row.exercise_ids[0], measure: row.measure })}>
                    ${row.trainee_full_name || row.trainee}
                  </a>
                </th>
                ${list !== 'struggling' && html`<td>${day(row.due_unix_ms)}</td>`}
                <td class="long">${row.exercise_ids.map(nameOf).join(', ')}</td>
                ${list === 'struggling' && html`<td>${rowTitle({ measure: row.measure }, kinds)}</td>`}
              </tr>`,
            )}<//>
            ${pages.button}
          `}<//>
  `;
}

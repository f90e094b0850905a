// The list of courses.
import { may } from '../lib/roles.js';
import { href } from '../lib/routes.js';
import { moment } from '../lib/time.js';
import { documents } from '../net/requests.js';
import { useLoad } from '../ui/hooks.js';
import { html } from '../ui/html.js';
import { Empty, Heading, Loaded, Mark, number, Table } from '../ui/widgets.js';

/** A course's name, and whether it is an exam. */
export function CourseName({ course }) {
  return html`
    <a href=${href(['courses', course.id])}>${course.name}</a> ${course.exam && html`<${Mark} kind="info">exam<//>`}
  `;
}

export function CoursesPage({ person }) {
  const load = useLoad((signal) => documents('courses').all(signal), []);
  return html`
    <${Heading} title="Courses">${
      may(person.role, 'edit courses') && html`<a class="button main" href="#/courses-new">New course</a>`
    }<//>
    <${Loaded} load=${load}>${(all) =>
      all.length === 0
        ? html`<${Empty} title="There are no courses yet">
            A course is a series of exercises: make one, then assign it to a group.
          <//>`
        : html`<${Table}
            caption="Courses"
            head=${['Course', 'Id', number('Exercises'), number('Revision'), 'Changed', 'More']}
          >${all.map(
            (c) => html`<tr key=${c.id}>
              <th scope="row"><${CourseName} course=${c} /></th>
              <td>${c.id}</td>
              <td class="number">${c.exercise_ids?.length ?? 0}</td>
              <td class="number">${c.revision}</td>
              <td>${moment(c.created_unix_ms)}</td>
              <td>
                <a href=${href(['courses', c.id, 'revisions'])} aria-label=${'Revisions of ' + c.name}>
                  Revisions
                </a> · <a href=${href(['results'], { course: c.id })} aria-label=${'Results of ' + c.name}>Results</a>
              </td>
            </tr>`,
          )}<//>`}<//>
  `;
}

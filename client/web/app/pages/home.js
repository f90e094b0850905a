// The home page: what each role can do.
import { may } from '../lib/roles.js';
import { html } from '../ui/html.js';
import { Heading } from '../ui/widgets.js';

/** [action, title, address, words] */
const kTasks = [
  ['see own', 'My results', '#/mine', 'What is assigned to me, what I passed, and how I improve.'],
  ['see live', 'Live lab', '#/live', 'Who is practising now, how deep, with what force.'],
  ['see results', 'Results', '#/results', 'Who passed which exercise; every session with plots, score and replay.'],
  ['edit people', 'Import a class', '#/people/import', 'A list of people as CSV, with a preview of what will change.'],
  ['see profiles', 'Patient profiles', '#/profiles', 'Layers of tissue, targets, hazards, and the forces they give.'],
  ['see courses', 'Courses', '#/courses', 'Exercises in order, with prerequisites, due dates and requirements.'],
  ['assign', 'Assignments', '#/assignments', 'Give a course or an exercise to a group or a trainee.'],
  ['see people', 'People and groups', '#/people', 'Who is registered, and who is in which group.'],
  [
    'assign sessions',
    'Unknown trainees',
    '#/unknown-trainees',
    'Sessions from stations without the server: unknown names, missing codes.',
  ],
  ['export', 'Exports', '#/exports', 'Scores and samples as CSV with units, for your own tools.'],
  ['retention', 'Retention', '#/retention', 'How long recordings are kept in full, and when they are deleted.'],
  ['see audit', 'Audit', '#/audit', 'Who changed what, and when.'],
  ['upkeep', 'Backup and check', '#/upkeep', 'Copy the database, check that all of it can be read, require codes.'],
];

export function Home({ person }) {
  const tasks = kTasks.filter(([action]) => may(person.role, action));
  return html`
    <${Heading} title=${'Welcome, ' + (person.full_name || person.name)} />
    <ul class="tiles">${tasks.map(
      ([, title, address, words]) =>
        html`<li class="tile"><h2><a href=${address}>${title}</a></h2><p>${words}</p></li>`,
    )}</ul>
    <p class="help">Press <kbd>?</kbd> for keyboard shortcuts.</p>
  `;
}

// Data for other tools: one list of formats, so that the next one is one more line.
import { may } from '../lib/roles.js';
import { address } from '../net/api.js';
import { documents, groups } from '../net/lab.js';
import { SelectField } from '../ui/fields.js';
import { useLoad } from '../ui/hooks.js';
import { html, useState } from '../ui/html.js';
import { Heading, Loaded } from '../ui/parts.js';

/** @type {{name: string, words: string, link: (choice: {course: string, group: string}) => string}[]} */
const kScoreFormats = [
  { name: 'CSV', words: 'one row per attempt and measure, units in the header', link: (choice) => address(['scores.csv'], choice) },
];

function Scores({ all }) {
  const [choice, setChoice] = useState({ course: '', group: '' });
  return html`<fieldset><legend>Scores</legend><div class="fields">
    <${SelectField} label="Course" value=${choice.course} onValue=${(course) => setChoice({ ...choice, course })} options=${[['', 'All courses'], ...all.courses.map((c) => [c.id, c.name])]} />
    <${SelectField} label="Group" value=${choice.group} onValue=${(group) => setChoice({ ...choice, group })} options=${[['', 'All groups'], ...all.groups.map((g) => [g.id, g.name])]} /></div>
    <ul class="plain">${kScoreFormats.map((f) => html`<li><a class="button main" href=${f.link(choice)} download>Download scores as ${f.name}</a> <span class="help">${f.words}</span></li>`)}</ul></fieldset>`;
}

export function ExportsPage({ person }) {
  const staff = may(person.role, 'see results');
  const load = useLoad(async (signal) => {
    if (!staff) return { courses: [], groups: [] };
    const [courses, all_groups] = await Promise.all([documents('courses').all(signal), groups.all(signal)]);
    return { courses, groups: all_groups };
  }, [staff]);
  if (!staff) {
    return html`<${Heading} title="Exports" /><p>For studies, recordings and scores of people who consent are exported under pseudonyms by the command line:</p>
      <pre tabindex="0"><code>needlelab-admin --server HOST:PORT --ca FILE --user ${person.name} study export STUDY --out FILE</code></pre>`;
  }
  return html`<${Heading} title="Exports" /><${Loaded} load=${load}>${(all) => html`<${Scores} all=${all} />
    <fieldset><legend>Samples of a session</legend><p>Each <a href="#/sessions">session</a> has its samples as CSV: every tick, units in the header.</p></fieldset>`}<//>`;
}

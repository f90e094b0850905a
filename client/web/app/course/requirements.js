// What an exercise asks for: bounds on measures, in the units that people use.
import { measureUnit } from '../lib/units.js';
import { html } from '../ui/html.js';

/** @param {{f: any, at: string, measures: {name: string, unit: string, words: string}[]}} props `at`: the exercise's path */
export function Requirements({ f, at, measures }) {
  const path = `${at}.requirements`;
  const rules = f.at(path) ?? [];
  const put = f.set(path);
  // measures of single layers are in no list: they stay as they are
  const options = (name) => [
    ['', 'Choose …'],
    ...measures.map((m) => [m.name, m.words ? `${m.words} (${m.name})` : m.name]),
    ...(name && !measures.some((m) => m.name === name) ? [[name, name]] : []),
  ];
  return html`
    <h3>Requirements to pass</h3>
    ${
      rules.length === 0 &&
      html`<p class="help">Without requirements every attempt is practice: nobody passes or fails.</p>`
    }
    <div>${rules.map((rule, i) => {
      const known = measures.find((m) => m.name === rule.measure);
      const { factor, unit } = measureUnit(known?.unit ?? '');
      const name = known?.words ?? rule.measure ?? `requirement ${i + 1}`;
      return html`<div key=${i} class="requirement fields" role="group" aria-label=${`Requirement ${i + 1}: ${name}`}>
        ${f.select(`${path}[${i}].measure`, 'Measure', options(rule.measure))}
        ${f.number(`${path}[${i}].min`, 'At least', { factor, unit })}
        ${f.number(`${path}[${i}].max`, 'At most', { factor, unit })}
        ${
          !f.readonly &&
          html`<div class="actions">
            <button
              type="button"
              class="small danger"
              aria-label=${`Remove requirement ${i + 1}`}
              onClick=${() => put(rules.filter((_, k) => k !== i))}
            >
              Remove
            </button>
          </div>`
        }
      </div>`;
    })}</div>
    ${
      !f.readonly &&
      html`<button type="button" onClick=${() => put([...rules, { measure: '' }])}>Add a requirement</button>`
    }
  `;
}

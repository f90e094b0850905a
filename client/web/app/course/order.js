// The row of exercises: click to choose one; buttons, Alt and arrows, or dragging change the order.
import { exerciseName, numbered } from '../lib/course_rules.js';
import { moved } from '../lib/paths.js';
import { announce, DangerButton, kOfTheForm } from '../ui/widgets.js';
import { Broken } from '../ui/fields.js';
import { html, useState } from '../ui/html.js';

/** @param {{f: any, chosen: number, choose: (index: number) => void, add: () => void, remove: (index: number) => void, faulty: Set<number>}} props */
export function ExerciseOrder({ f, chosen, choose, add, remove, faulty }) {
  const exercises = f.doc.exercises ?? [];
  const [dragged, setDragged] = useState(-1);
  const nameOf = (i) => exerciseName(exercises[i], i);
  const move = (from, to) => {
    if (to < 0 || to >= exercises.length || from === to) return;
    f.edit('exercises', (all) => moved(all, from, to));
    choose(to);
    announce(`${nameOf(from)} is number ${to + 1} of ${exercises.length} now.`);
    requestAnimationFrame(() => document.getElementById(`exercise-${to}`)?.focus());
  };
  const keys = (i) => (event) => {
    if (!event.altKey || !['ArrowUp', 'ArrowDown'].includes(event.key) || f.readonly) return;
    event.preventDefault();
    move(i, i + (event.key === 'ArrowUp' ? -1 : 1));
  };
  const drag = (i) =>
    f.readonly
      ? {}
      : {
          draggable: true,
          onDragStart: (event) => {
            setDragged(i);
            event.dataTransfer.effectAllowed = 'move';
          },
          onDragOver: (event) => dragged >= 0 && event.preventDefault(),
          onDrop: (event) => {
            event.preventDefault();
            move(dragged, i);
            setDragged(-1);
          },
          onDragEnd: () => setDragged(-1),
        };
  return html`<section aria-label="Exercises in order">
    <h2>Exercises</h2>
    <${Broken} f=${f} path="exercises" />
    ${
      exercises.length === 0 &&
      !f.faultAt('exercises') &&
      html`<div class="empty">
        <p><strong>No exercises yet</strong></p>
        <p>Add the first one: a patient to practise on, and what is needed to pass.</p>
      </div>`
    }
    <ol class="order">${exercises.map(
      (exercise, i) => html`<li
        key=${i}
        class=${`${i === chosen ? 'order-chosen' : ''} ${i === dragged ? 'dragged' : ''}`}
        onKeyDown=${keys(i)}
        ...${drag(i)}
      >
        <button
          type="button"
          class="order-name"
          id=${`exercise-${i}`}
          aria-current=${i === chosen ? 'true' : undefined}
          onClick=${() => choose(i)}
        >
          ${numbered(i, nameOf(i))}
          ${faulty.has(i) && html` <span class="error">✗ has problems</span>`}
        </button>
        ${
          !f.readonly &&
          html`<div class="actions">
            <button
              type="button"
              class="small"
              disabled=${i === 0}
              aria-label=${`Move ${nameOf(i)} up`}
              onClick=${() => move(i, i - 1)}
            >
              ↑
            </button>
            <button
              type="button"
              class="small"
              disabled=${i === exercises.length - 1}
              aria-label=${`Move ${nameOf(i)} down`}
              onClick=${() => move(i, i + 1)}
            >
              ↓
            </button>
            <${DangerButton}
              small
              text="Remove"
              label=${`Remove ${nameOf(i)}`}
              title=${`Remove ${nameOf(i)}?`}
              act=${() => remove(i)}
            >
              ${kOfTheForm}
            <//>
          </div>`
        }
      </li>`,
    )}</ol>
    ${
      !f.readonly &&
      !f.faultAt('exercises') &&
      html`
        <button type="button" onClick=${add}>Add an exercise</button>
        <p class="help">Drag, or Alt + ↑ ↓ on a name, to change the order.</p>
      `
    }
  </section>`;
}

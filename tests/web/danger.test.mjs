// A button that destroys something asks first, and Enter in its question destroys nothing.
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { test } from 'node:test';
import { Confirm } from '../../client/web/app/ui/widgets.js';

const kApp = new URL('../../client/web/app/', import.meta.url);
const kDestroys = /\b(Remove|Delete|Revoke|Erase|Redact|Disable|Discard|End|Drop|Take (away|back))\b/;

/** All buttons that are written out, with their file. */
const buttons = readdirSync(kApp, { recursive: true })
  .filter((file) => file.endsWith('.js'))
  .flatMap((file) =>
    [...readFileSync(new URL(file, kApp), 'utf8').matchAll(/<button\b[\s\S]*?<\/button>/g)].map(([text]) => ({
      file,
      text,
    })),
  );
/** The element and all below it; components are not drawn. */
const all = (node) =>
  Array.isArray(node) ? node.flatMap(all) : node?.props ? [node, ...all(node.props.children)] : [];

test('what destroys is a DangerButton, or a button that opens a question', () => {
  assert.ok(buttons.length > 50);
  const asks = ({ text }) => /onClick=\$\{\(\) => set\w+\(true\)\}/.test(text) && /…\s*<\/button>$/.test(text);
  const at_once = buttons.filter((b) => (/danger/.test(b.text) || kDestroys.test(b.text)) && !asks(b));
  // the question's own button
  assert.deepEqual(
    at_once.map(({ file, text }) => [file, /onClick=\$\{(\w+)\}/.exec(text)?.[1]]),
    [['ui/widgets.js', 'act']],
  );
});

test('a question has Cancel first, where the browser puts the focus', () => {
  const acted = [];
  const question = Confirm({
    title: 'Remove it?',
    word: 'Remove',
    children: 'It goes.',
    act: () => acted.push('act'),
    close: () => acted.push('close'),
  });
  const [first, second, ...more] = all(question).filter((node) => node.type === 'button');
  assert.deepEqual([first.props.children, second.props.children, more], ['Cancel', 'Remove', []]);
  assert.equal(second.props.autofocus, undefined);
  // neither sends a form that the question stands in
  assert.deepEqual([first.props.type, second.props.type], ['button', 'button']);
  first.props.onClick();
  assert.deepEqual(acted, ['close']);
});

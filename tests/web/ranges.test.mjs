// The greatest value of each number field of profiles and courses, which decides whether a field asks what "1,200" means.
// NEEDLELAB_WRITE_RANGES=1 node --test tests/web/ranges.test.mjs writes the table.
import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { test } from 'node:test';

const file = new URL('../../client/web/app/profile/ranges.js', import.meta.url);

/** By the field's name; where messages differ, the widest. */
function rangesOf(proto) {
  const most = {},
    whole = new Set();
  for (const [, type, name, options] of proto.matchAll(/optional (\w+) (\w+) = \d+ \[([^\]]*)\]/g)) {
    const range = /\(range\) = \{([^}]*)\}/.exec(options)?.[1];
    if (!range) continue;
    const [least, greatest] = ['min', 'max'].map((end) => Number(new RegExp(`${end}: ([^,\\s]+)`).exec(range)[1]));
    most[name] = Math.max(most[name] ?? 0, Math.abs(least), greatest);
    if (type !== 'double') whole.add(name);
  }
  return { most, whole: [...whole] };
}

test('the table has the ranges of proto/needlelab/profile.proto', async () => {
  const { most, whole } = rangesOf(
    readFileSync(new URL('../../proto/needlelab/profile.proto', import.meta.url), 'utf8'),
  );
  assert.equal(most.thickness_m, 1);
  assert.ok(whole.includes('gauge'));
  if (process.env.NEEDLELAB_WRITE_RANGES) {
    const lines = [''];
    for (const [name, value] of Object.entries(most)) {
      if (`${lines.at(-1)} ${name}: ${value},`.length > 116) lines.push('');
      lines.push(`${lines.pop()} ${name}: ${value},`.trim());
    }
    writeFileSync(
      file,
      `// The greatest value, in SI, of each number field of profiles and courses, and the fields of whole numbers. Made from
// proto/needlelab/profile.proto; not to be edited (tests/web/ranges.test.mjs).
// prettier-ignore
export const kMost = {\n${lines.map((line) => `  ${line}\n`).join('')}};
export const kWhole = [${whole.map((name) => `'${name}'`).join(', ')}];\n`,
    );
  }
  const { kMost, kWhole } = await import(file);
  assert.deepEqual({ ...kMost }, most);
  assert.deepEqual(kWhole, whole);
});

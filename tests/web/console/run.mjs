// Runs the console's tests for ctest by node's own runner. Exits with 77 (skipped) and prints what is missing if they
// cannot run.
// usage: node tests/web/console/run.mjs [--large FOLDER]   --large: large.mjs with that folder instead of them
// environment: NEEDLELAB_BIN, NEEDLELAB_WEB_ROOT, NEEDLELAB_CHROMIUM, NEEDLELAB_SHOTS=DIR, NEEDLELAB_KEEP=1
import { spawnSync } from 'node:child_process';
import { accessSync, constants } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = fileURLToPath(new URL('.', import.meta.url));
const bin = process.env.NEEDLELAB_BIN ?? join(here, '../../../build/quick/bin');

function runs(file) {
  try {
    accessSync(file, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}

async function missing() {
  if (Number(process.versions.node.split('.')[0]) < 18)
    return `node ${process.version} is too old: 18 or later is needed`;
  for (const name of ['playwright-core', 'axe-core']) {
    try {
      await import(name);
    } catch (error) {
      return `the npm package ${name} is not in tests/web/node_modules (${error.code ?? error.message}): run deploy/setup where the npm registry can be reached`;
    }
  }
  const { kChromium } = await import('./browser.mjs');
  if (!runs(kChromium)) return `there is no ${kChromium} (Debian's package chromium-headless-shell): run deploy/setup`;
  const lost = ['needlelab-server', 'needlelab-admin', 'needlelab-station', 'needlelab-instructor'].find(
    (name) => !runs(join(bin, name)),
  );
  return lost && `${join(bin, lost)} is not built`;
}

const reason = await missing();
if (reason) {
  console.log(`skipped: ${reason}`);
  process.exitCode = 77;
} else {
  const [way, folder] = process.argv.slice(2);
  const what = way === '--large' ? [join(here, 'large.mjs'), folder] : ['--test', join(here, 'console.test.mjs')];
  const { status } = spawnSync(process.execPath, what, { stdio: 'inherit' });
  process.exitCode = status ?? 1;
}

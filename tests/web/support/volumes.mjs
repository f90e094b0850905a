// The patients of db/samples/volumes.
import { readdirSync, readFileSync } from 'node:fs';

const folder = new URL('../../../db/samples/volumes/', import.meta.url);
export const kVolumes = readdirSync(folder)
  .filter((name) => /-(slender|median|heavy)\.json$/.test(name))
  .map((name) => JSON.parse(readFileSync(new URL(name, folder), 'utf8')));
export const lumbar = kVolumes.find((p) => p.id === 'lumbar-median');

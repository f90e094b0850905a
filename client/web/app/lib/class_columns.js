// The columns of a class list: where the header does not say which is the account, full name or group, a person chooses
// once, and the browser remembers it for that header. The server reads the list; here only words of its header change.

/** What a person chooses: the server's name for it, the label, and the word that the header gets. */
export const kChoices = [
  ['name', 'Account', 'account'],
  ['full_name', 'Full name', 'full_name'],
  ['group', 'Group', 'group'],
];
/** As the full name: given and family name together. */
export const kParts = ' parts';
const kPartNames = ['given_name', 'family_name'];
const kPlace = 'needlelab class list columns';

/** The index of the header among lines and line ends. */
const headerAt = (pieces, lines_above) =>
  pieces.findIndex((line, i) => i >= 2 * lines_above && /[^\s,;]/.test(line) && !/^sep=.$/.test(line));
const piecesOf = (csv) => csv.split(/(\r\n|\r|\n)/);

/** The header's line; '' without one. @param {string} csv @param {number} lines_above */
export function headerOf(csv, lines_above) {
  const pieces = piecesOf(csv);
  return pieces[headerAt(pieces, lines_above)] ?? '';
}

/** @typedef {{cell: string, taken_as: string}} Column `taken_as`: '' if it is ignored */

/** The columns of a header that is not in needlelab's own words. @param {any} report of an import @returns {Column[]} */
export const columnsOf = (report) =>
  (report.rows ?? [])
    .filter((row) => !row.what || row.what === 'WHAT_UNSPECIFIED')
    .map((row) => ({ cell: row.column ?? '', taken_as: row.name ?? '' }));

/** What the server takes by itself, as a choice. @param {Column[]} columns */
export function takenOf(columns) {
  const cellOf = (name) => columns.find((c) => c.taken_as === name)?.cell ?? '';
  const parts = kPartNames.some(cellOf);
  return { name: cellOf('name'), full_name: cellOf('full_name') || (parts ? kParts : ''), group: cellOf('group') };
}

/** The header's words that must change for a choice. @param {Column[]} columns @param {Record<string, string>} chosen cells */
export function renamesOf(columns, chosen) {
  const renames = {};
  for (const { cell, taken_as } of columns) {
    const part = kPartNames.includes(taken_as);
    const chosen_as = kChoices.find(([name]) => chosen[name] === cell);
    if (chosen_as) renames[cell] = chosen_as[2];
    else if (part ? chosen.full_name !== kParts : taken_as in chosen) renames[cell] = `${cell} (not used)`;
  }
  return renames;
}

/** The list with those words in its header. @param {string} csv @param {number} lines_above @param {Record<string, string>|null} renames */
export function withColumns(csv, lines_above, renames) {
  const pieces = piecesOf(csv),
    at = headerAt(pieces, lines_above);
  for (const [cell, word] of Object.entries(renames ?? {})) {
    const text = cell.replace(/[.*+?^${}()|[\]\\/]/g, '\\$&').replaceAll('"', '""?');
    const whole = new RegExp(`(^\\s*"?|[,;\\t]\\s*"?)${text}(?=\\s*"?\\s*(?:[,;\\t]|$))`);
    pieces[at] = pieces[at]?.replace(whole, (_, before) => before + word);
  }
  return pieces.join('');
}

/** The renames chosen earlier for this header, or null. */
export function remembered(header) {
  try {
    return JSON.parse(localStorage.getItem(kPlace))?.[header] ?? null;
  } catch {
    return null;
  }
}

/** @param {string} header @param {Record<string, string>|null} renames null: forgets it */
export function remember(header, renames) {
  try {
    const all = JSON.parse(localStorage.getItem(kPlace)) ?? {};
    if (renames) all[header] = renames;
    else delete all[header];
    localStorage.setItem(kPlace, JSON.stringify(all));
  } catch {
    // the storage is full or forbidden: it is asked again
  }
}

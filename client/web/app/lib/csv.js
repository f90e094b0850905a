// Comma-separated values by RFC 4180; a semicolon or a tab in place of the comma is recognised by the first line.

/** @typedef {{line: number, cells: string[]}} CsvRow `line` is that of the file at which the row begins, from 1 */

/**
 * The separator of the columns: the most frequent of `,`, `;` and tab in the first line, outside quotes.
 * @param {string} text
 */
export function separatorOf(text) {
  const first = text.replace(/"(?:[^"]|"")*"/g, '').split(/\r?\n/, 1)[0];
  const count = (mark) => first.split(mark).length - 1;
  return [',', ';', '\t'].reduce((best, mark) => (count(mark) > count(best) ? mark : best), ',');
}

/**
 * All rows that are not empty, the header among them.
 * @param {string} text a byte order mark is passed over
 * @param {string} [separator]
 * @returns {CsvRow[]}
 * @throws {Error} on a quote that is not closed, naming its line
 */
export function parseCsv(text, separator = separatorOf(text)) {
  const rows = [];
  let cells = [],
    cell = '',
    quoted = false,
    line = 1,
    begin = 1,
    opened = 1;
  const endCell = () => {
    cells.push(cell);
    cell = '';
  };
  const endRow = () => {
    endCell();
    if (cells.some((c) => c.trim() !== '')) rows.push({ line: begin, cells });
    cells = [];
  };
  const from = text.charCodeAt(0) === 0xfeff ? 1 : 0;
  for (let i = from; i < text.length; i++) {
    const c = text[i];
    if (c === '\n') line++;
    if (quoted) {
      if (c !== '"') cell += c;
      else if (text[i + 1] === '"') {
        cell += '"';
        i++;
      } else quoted = false;
    } else if (c === '"' && cell === '') {
      quoted = true;
      opened = line;
    } else if (c === separator) endCell();
    else if (c === '\n') {
      endRow();
      begin = line;
    } else if (c === '\r' && (text[i + 1] === '\n' || i + 1 === text.length)) continue;
    else cell += c;
  }
  if (quoted) throw new Error(`line ${opened}: a quote is opened and never closed`);
  endRow();
  return rows;
}

/**
 * @param {string[][]} rows
 * @returns {string} with commas and CRLF; cells are quoted where they must be
 */
export function writeCsv(rows) {
  const quote = (cell) => (/[",\r\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
  return rows.map((cells) => cells.map((cell) => quote(String(cell))).join(',') + '\r\n').join('');
}

/**
 * A class list: which of the wanted columns it has, by name in any order and case.
 * @param {string} text
 * @param {string[]} wanted
 * @returns {{columns: string[], unknown: string[], missing: string[], rows: {line: number, values: Record<string, string>}[]}}
 */
export function readTable(text, wanted) {
  const [header, ...body] = parseCsv(text);
  const columns = (header?.cells ?? []).map((name) => name.trim().toLowerCase());
  return {
    columns,
    unknown: columns.filter((name) => !wanted.includes(name)),
    missing: wanted.filter((name) => !columns.includes(name)),
    rows: body.map(({ line, cells }) => ({
      line,
      values: Object.fromEntries(columns.map((name, i) => [name, (cells[i] ?? '').trim()])),
    })),
  };
}

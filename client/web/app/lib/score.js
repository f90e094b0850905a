// Rows of a score as people read them.

/**
 * What a row is called: its sentence says "Peak force 2.52 N: within the 5 N allowed", a plot and a table want "Peak force".
 * @param {{measure: string, words?: string}} row
 */
export function measureTitle(row) {
  const name = (row.words ?? '')
    .split(':')[0]
    .replace(/\s[-−]?\d[\d.]*(e[-+]?\d+)?(\s?(%|[^\s\d(]{1,5}))?$/u, '')
    .trim();
  return name || row.measure;
}

// What the measures of a score are called. The server lists the kinds; a kind that each layer has is one row with a K in
// place of the layer's number (common/scoring/measure_table.h). Pure.

/** @typedef {{name: string, unit: string, words: string}} Kind */

/**
 * A measure by its name, "Peak force in dura"; with the layer's number where the patient has no such layer.
 * @param {Kind[]} kinds
 * @param {string} name "peak_force_layer_3_n"
 * @param {string[]} layers `layerNames` of the patient
 * @returns {Kind|undefined} nothing: no score has it
 */
export function measureNamed(kinds, name, layers) {
  for (const kind of kinds) {
    const [before, after] = kind.name.split('K');
    if (after === undefined && kind.name === name) return kind;
    if (after === undefined || !name?.startsWith(before) || !name.endsWith(after)) continue;
    const number = name.slice(before.length, name.length - after.length);
    if (!/^[1-9]\d*$/.test(number)) continue;
    const layer = layers[Number(number) - 1];
    const words = layer === undefined ? kind.words.replace('K', number) : kind.words.replace('layer K', () => layer);
    return { ...kind, name, words };
  }
  return undefined;
}

/**
 * All measures of scores of one patient: those that each layer has once for each.
 * @param {Kind[]} kinds
 * @param {string[]} layers
 * @returns {Kind[]}
 */
export function measuresOf(kinds, layers) {
  return kinds.flatMap((kind) =>
    kind.name.includes('K')
      ? layers.map((_, i) => measureNamed([kind], kind.name.replace('K', i + 1), layers))
      : [kind],
  );
}

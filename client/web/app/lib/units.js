// Numbers with units as people read them: SI prefixes, the browser's own decimal sign.

const kPrefixes = [
  [1e9, 'G'],
  [1e6, 'M'],
  [1e3, 'k'],
  [1, ''],
  [1e-3, 'm'],
  [1e-6, 'µ'],
  [1e-9, 'n'],
];
// units without a prefix, or with a fixed one (common/base/units.h): 8.7 mN would be unusual
const kFixed = {
  N: [1, 'N'],
  'N·m': [1, 'N·m'],
  'm^2': [1e4, 'cm²'],
  'm/s': [1e3, 'mm/s'],
  s: [1, 's'],
  '': [1, ''],
  rad: [180 / Math.PI, '°'],
  'rad/s': [180 / Math.PI, '°/s'],
};
// below 1 in thousandths, as in the server's sentences
const kInThousandths = { m: 'mm', J: 'mJ' };
const kFinest = 1e3; // shown units per least step: less than 0.001 N or 0.001 mm is noise

// made once for each number of digits and locale: that takes a tenth of a millisecond
const kFormats = new Map();

/**
 * @param {number} value
 * @param {number} [digits] significant ones
 * @param {string} [locale]
 */
export function number(value, digits = 3, locale = undefined) {
  const key = `${digits} ${locale}`;
  if (!kFormats.has(key))
    kFormats.set(key, new Intl.NumberFormat(locale, { maximumSignificantDigits: digits, useGrouping: false }));
  return kFormats.get(key).format(value);
}

/**
 * What a spreadsheet of this locale takes as the end of a cell: a semicolon if the decimal sign is a comma.
 * @param {string} [locale]
 * @returns {'comma'|'semicolon'} as `separator` of the table's address
 */
export const csvSeparator = (locale = undefined) => (number(1.5, 3, locale).includes(',') ? 'semicolon' : 'comma');

/**
 * "3.1 mm", "0.009 N", "12 cm²", "2"; "–" for what is not a number.
 * @param {number|null|undefined} value in SI
 * @param {string} unit of the value, as the server names it: m, N, s, m/s, m^2, …
 * @param {{digits?: number, locale?: string}} [options]
 */
export function quantity(value, unit, { digits = 3, locale } = {}) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  // whole percents, as in percentText of common/scoring
  if (unit === 'share') return `${number(Math.round(100 * value) || 0, 15, locale)}\u00a0%`;
  const size = Math.abs(value);
  const small = Number(size.toPrecision(digits)) < 1 && kInThousandths[unit];
  const fixed = small ? [1e3, small] : kFixed[unit];
  if (fixed) {
    const rounded = Math.round(value * fixed[0] * kFinest) / kFinest || 0;
    return `${number(rounded, digits, locale)}${fixed[1] && fixed[1] !== '°' ? '\u00a0' : ''}${fixed[1]}`;
  }
  const [factor, prefix] =
    size === 0
      ? [1, '']
      : kPrefixes.find(([f], i) => Number((size / f).toPrecision(digits)) >= 1 || i === kPrefixes.length - 1);
  return `${number(value / factor, digits, locale)}\u00a0${prefix}${unit}`;
}

/**
 * Units in which fields of a document are edited, by the end of their name; the longest match wins. [suffix, SI per
 * shown unit, shown, SI's own]
 */
const kFieldUnits = [
  ['_n_per_m2', 1, 'N/m²'],
  ['_n_per_m', 1, 'N/m'],
  ['_nm_per_rad', 1, 'N·m/rad'],
  ['_ns_per_m2', 1, 'N·s/m²'],
  ['_ns_per_m', 1, 'N·s/m'],
  ['_nm', 1, 'N·m'],
  ['_m_s', 1e-3, 'mm/s', 'm/s'],
  ['_rad', Math.PI / 180, '°', 'rad'],
  ['_pa', 1e3, 'kPa', 'Pa'],
  ['_m2', 1e-4, 'cm²', 'm²'],
  ['_m', 1e-3, 'mm', 'm'],
  ['_n', 1, 'N'],
  ['_s', 1, 's'],
  ['_hz', 1, 'Hz'],
];

/**
 * @param {string} name of a field, e.g. thickness_m
 * @returns {{factor: number, unit: string, si: string}} SI value = shown value · factor; `si`: the unit of the value
 */
export function fieldUnit(name) {
  const found = kFieldUnits.find(([suffix]) => name.endsWith(suffix));
  return found ? { factor: found[1], unit: found[2], si: found[3] ?? found[2] } : { factor: 1, unit: '', si: '' };
}

/** Like `fieldUnit`, by the unit's name, for measures. */
export function measureUnit(unit) {
  const fixed = { m: [1e-3, 'mm'], 'm/s': [1e-3, 'mm/s'], 'm^2': [1e-4, 'cm²'], rad: [Math.PI / 180, '°'] }[unit] ?? [
    1,
    unit,
  ];
  return { factor: fixed[0], unit: fixed[1] };
}

const kOutOfRange = /^(\S+) is out of range ([[(])([^\s,]+), ([^\s,\])]+)([\])])$/;

/**
 * A message of the server, which is in SI, under a field in another unit: "-0.003 is out of range (0, 1]" in a field in
 * mm is "-3 mm is out of range: allowed is more than 0, at most 1000 mm". Adds the unit to other messages with a number.
 * @param {string} message
 * @param {{factor: number, unit: string, si: string}} shown_unit as from fieldUnit
 */
export function messageIn(message, { factor, unit, si }) {
  const found = kOutOfRange.exec(message);
  if (found) {
    const [, value, open, least, greatest, close] = found;
    const text = (number, digits) => String(Number((Number(number) / factor).toPrecision(digits)));
    const [low, high] = [text(least, 4), text(greatest, 4)],
      after = unit && ` ${unit}`;
    const allowed =
      open === '[' && close === ']'
        ? `${low} to ${high}`
        : `${open === '(' ? 'more than' : 'at least'} ${low}, ${close === ')' ? 'less than' : 'at most'} ${high}`;
    return `${text(value, 6)}${after} is out of range: allowed is ${allowed}${after}`;
  }
  return si === unit || !/\d/.test(message) || message.includes(` ${unit}`)
    ? message
    : `${message} (in ${si}, not ${unit})`;
}

/** The unit of the field at a path of a document: of "layers[0].thickness_m", of "targets[1].center_m.x". */
export const unitAt = (path) =>
  fieldUnit(
    path
      .replace(/\.[xyz]$/, '')
      .split('.')
      .at(-1),
  );

/**
 * The text of a field for an SI value, rounded to 12 digits so that 0.003 m is 3 mm and not 3.0000000000000004. A value
 * of a wrong type is shown as JSON, which `typed` does not take for a number.
 * @param {any} value
 * @param {number} factor
 */
export function shown(value, factor) {
  if (value === null || value === undefined) return '';
  return typeof value === 'number' ? String(Number((value / factor).toPrecision(12))) : JSON.stringify(value);
}

/** The digits of any script as 0 to 9; a decimal sign of Arabic or of full width as a plain one. @param {string} text */
const plainDigits = (text) =>
  text
    .replace(/\p{Nd}/gu, (digit) => {
      const at = digit.codePointAt(0);
      // each script has its ten digits in a row, and such rows may follow each other
      let zero = at;
      while (/\p{Nd}/u.test(String.fromCodePoint(zero - 1))) zero--;
      return String((at - zero) % 10);
    })
    .replace(/[\uff0b-\uff0e]/g, (sign) => String.fromCharCode(sign.charCodeAt(0) - 0xfee0))
    .replace('\u066b', '.')
    .replace('\u2212', '-');

/** The sign by which this locale groups thousands. @param {string} [locale] */
const groupSign = (locale) =>
  new Intl.NumberFormat(locale, { useGrouping: 'always' }).formatToParts(1234567).find((part) => part.type === 'group')
    ?.value;

/**
 * The SI value of typed text. Comma and point are decimal signs in every locale. Where exactly three digits follow the
 * one by which the locale groups thousands, the text may mean a thousand times as much: `asks` has both numbers, unless
 * only one of them can be meant.
 * @param {string} text
 * @param {number} factor
 * @param {{most?: number, whole?: boolean, locale?: string}} [field] `most`: the greatest allowed value, in SI; `whole`: has no fractions
 * @returns {number|undefined|null|{asks: string[]}} undefined: empty; null: not a number
 */
export function typed(text, factor, { most = Infinity, whole = false, locale } = {}) {
  const plain = plainDigits(text.trim());
  if (plain === '') return undefined;
  const decimal = plain.replace(/^([+-]?\d*),(\d+)$/, '$1.$2');
  const found = /^([+-]?[1-9]\d{0,2})([.,])(\d{3})$/.exec(plain);
  if (found && found[2] === groupSign(locale)) {
    const both = [String(Number(decimal)), String(Number(found[1] + found[3]))];
    const can_be = both.filter((n) => Math.abs(n * factor) <= most * (1 + 1e-12) && (!whole || Number.isInteger(+n)));
    if (can_be.length === 2) return { asks: both };
    if (can_be.length === 1) return Number((can_be[0] * factor).toPrecision(12));
  }
  const value = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i.test(decimal) ? Number(decimal) : NaN;
  return Number.isFinite(value) ? Number((value * factor).toPrecision(12)) : null;
}

/** "512 B", "3.4 MB" */
export function bytes(value, locale = undefined) {
  const [factor, prefix] = kPrefixes.find(([f]) => f >= 1 && value >= f) ?? [1, ''];
  return `${number(value / factor, 3, locale)}\u00a0${prefix}B`;
}

/** "1 session", "2 sessions", "0 entries" */
export const counted = (n, one, many = `${one}s`) => `${n} ${n === 1 ? one : many}`;

/** "25 sessions, newest first"; "The newest 25 sessions" of a list that has `more`. */
export const newest = (n, more, one, many) =>
  more ? `The newest ${counted(n, one, many)}` : `${counted(n, one, many)}, newest first`;

/** "25 trainees"; "25 of 3000 trainees" of a list that shows a part. */
export const shownOf = (n, total, one, many) =>
  total === undefined || n >= total ? counted(n, one, many) : `${n} of ${counted(total, one, many)}`;

/** "epidural space" at the beginning of a line: "Epidural space" */
export const atStart = (text) => String(text ?? '').replace(/^./u, (first) => first.toUpperCase());

/** "PUNCTURE_FORCE" or "curriculum-manager" as words: "Puncture force" */
export function words(name) {
  return atStart(
    String(name ?? '')
      .replace(/[_-]+/g, ' ')
      .toLowerCase(),
  );
}

// a value in a sentence: "2.52 N", "6.38°", "-16.6", "3.2e-05 m"
const kValue = String.raw`[-−]?\d[\d.]*(?:e[-+]?\d+)?(?:\s?(?:%|[^\s\d(]{1,5}))?`;
// a whole verdict, as common/scoring/measures/score_report.cpp writes it, because a layer's own name may have the same
// words
const kVerdict = new RegExp(
  `: (?:(?:within|(?:just )?above) the ${kValue} allowed|(?:at least|(?:just )?below) the ${kValue} asked for|` +
    `within ${kValue} to ${kValue}|it had to be|this was not allowed|it had to be avoided)$`,
  'u',
);
const kValueAtEnd = new RegExp(String.raw`\s${kValue}$`, 'u');

/**
 * The title of a row of a score: its sentence is "Peak force 2.52 N: within the 5 N allowed", and plots and tables
 * need "Peak force".
 * @param {{measure: string, words?: string}} row
 */
export function measureTitle(row) {
  const name = (row.words ?? '').replace(kVerdict, '').replace(kValueAtEnd, '').trim();
  return name || row.measure;
}

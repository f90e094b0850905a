// Invisible characters. They turn the direction of the text behind them, or make two names look alike. New names may
// not contain them (checkVisible of common/base/text/text.h); in older names such a character is written out.

/** First and last code point of each row: the table `kHidden` of common/base/text/text.cpp. */
export const kHidden = [
  [0x00ad, 0x00ad],
  [0x061c, 0x061c],
  [0x180e, 0x180e],
  [0x200b, 0x200f],
  [0x2028, 0x202e],
  [0x2060, 0x2064],
  [0x2066, 0x206f],
  [0xfeff, 0xfeff],
  [0xfff9, 0xfffb],
  [0xe0000, 0xe007f],
];
/** Joiners spell Persian and Indian names: between two characters from this one on, they are not hidden characters. */
const kFirstJoined = 0x0590;

const isHidden = (point) => kHidden.some(([first, last]) => point >= first && point <= last);
const isJoiner = (point) => point === 0x200c || point === 0x200d;
const joins = (point) => point >= kFirstJoined && !isHidden(point);
const kAny = new RegExp(
  `[${kHidden.map(([first, last]) => `\\u{${first.toString(16)}}-\\u{${last.toString(16)}}`).join('')}]`,
  'u',
);

/** The text with each hidden character as "[U+202E]". */
export function visibleText(text) {
  if (!kAny.test(text)) return text;
  const points = Array.from(text, (character) => character.codePointAt(0));
  return points
    .map((point, i) =>
      isHidden(point) && !(isJoiner(point) && joins(points[i - 1] ?? 0) && joins(points[i + 1] ?? 0))
        ? `[U+${point.toString(16).toUpperCase().padStart(4, '0')}]`
        : String.fromCodePoint(point),
    )
    .join('');
}

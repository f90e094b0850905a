// The formats of the console's downloads. Made by export_test from the table in common/export;
// not to be edited (tests/unit/common/export/export_formats_test.cpp).
// prettier-ignore
export const kExportFormats = {
  samples: [
    { name: 'csv', suffix: '.csv', type: 'text/csv; charset=utf-8', title: 'CSV', words: 'every tick, units in the header' },
  ],
  scores: [
    { name: 'csv', suffix: '.csv', type: 'text/csv; charset=utf-8', title: 'CSV', words: 'one row per attempt and measure, units in the header' },
  ],
  results: [
    { name: 'csv', suffix: '.csv', type: 'text/csv; charset=utf-8', title: 'CSV', words: 'a row for each person and exercise, with the measures that the course asks for' },
  ],
  study: [
    { name: 'jsonl', suffix: '.jsonl', type: 'application/x-ndjson', title: 'JSON lines', words: 'sessions and scores' },
  ],
};

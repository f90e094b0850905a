/// A course's results for a spreadsheet: one wide table, a row for each person and exercise, a column for
/// each measure that the course asks for.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/csv.h"
#include "common/base/result.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The unit in which all values of a measure are shown in one column: mm, mm/s, mJ, cm², °, s, N, % of
/// shares, none for counts. `name`: of a score's row; an unknown one is shown as it is.
struct ColumnUnit {
  double per_si = 1;  ///< shown value = value in SI * per_si
  std::string_view unit;
};
ColumnUnit columnUnitOf(std::string_view name);

/// CSV by RFC 4180, UTF-8 with a byte order mark. Columns: person, full name, groups (separated by "; "),
/// exercise, verdict (verdictName(), "not tried", "excused": no attempt counts), attempts that count,
/// attempts left (empty: unlimited), number and date of the best attempt (UTC, ISO 8601); then each measure
/// with its unit, of the best attempt's first score; empty where it has none. Thread: one at a time.
class ResultTable {
 public:
  explicit ResultTable(const CsvStyle& style) : style_(style) {}

  /// The mark and the header. `first`: of the pages of GetResults with `with_measures`; all rows have its
  /// columns, and its names of the exercises.
  void begin(std::string& out, const pb::Results& first);
  /// One row. kCorrupt: the score is none; nothing is added.
  Status add(std::string& out, const pb::ResultRow& person, const pb::ResultCell& cell) const;

 private:
  CsvStyle style_;
  std::vector<std::string> measures_;
  std::map<std::string, std::string> exercise_names_;  ///< by id
};

}  // namespace needlelab

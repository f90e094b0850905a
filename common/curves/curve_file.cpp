#include "common/curves/curve_set.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <tuple>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/plausible.h"
#include "common/base/range.h"
#include "common/base/text/csv_rows.h"
#include "common/base/text/text.h"
#include "common/curves/curve_phases.h"
#include "common/curves/curve_zero.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxCells = 256;  // per line

enum CurveCell : std::size_t {
  kForceCell,
  kDepthCell,
  kTimeCell,
  kSpeedCell,
  kDiameterCell,
  kCurveCell,
  kSpecimenCell,
  kNeedleCell,
  kTissueCell,
  kPhaseCell,
  kCellKinds
};
constexpr std::array<std::string_view, kCellKinds> kCellNames = {
    "force_n", "depth_m",  "t_s",    "speed_m_s", "needle_diameter_m",
    "curve",   "specimen", "needle", "tissue",    "phase"};
constexpr std::array<NumberRange, 5> kCellRanges = {kCurveForce_N, kCurveDepth_m, kCurveTime_s,
                                                    kCurveSpeed_mps, kCurveDiameter_m};
constexpr std::array<Quantity, 5> kCellQuantities = {Quantity::kForce, Quantity::kDepth, Quantity::kTime,
                                                     Quantity::kSpeed, Quantity::kDiameter};

std::string shown(std::string_view cell) {
  return "'" + printable(cell.substr(0, 40)) + "'";
}

class CurveFile {
 public:
  CurveFile(fs::path path, CurveFacts facts, CurveReading reading)
      : path_(std::move(path)), facts_(std::move(facts)), reading_(reading) {}

  /// Reads the header. `missing`: what neither columns nor facts give, as text; empty if complete.
  Status open(std::string& missing);
  /// Returns all curves of the file. Reduces `rows_left` by the rows read.
  Result<std::vector<ForceCurve>> read(std::size_t& rows_left);

 private:
  [[nodiscard]] bool has(CurveCell column) const { return at_[column].has_value(); }
  [[nodiscard]] Error lineError(const std::string& why) const {
    return wrongInput(fmt::format("{} line {}", path_.string(), rows_->line()), why);
  }
  Result<bool> nextRow();
  Status header();
  Result<double> numberIn(CurveCell column) const;
  [[nodiscard]] double greatestIn(CurveCell column) const;
  Status textIn(CurveCell column, const std::string& known, std::string& into) const;
  Result<CurvePhase> phaseIn() const;
  Status addRow(std::vector<CurveRows>& curves);
  Result<ForceCurve> finished(CurveRows rows) const;

  fs::path path_;
  CurveFacts facts_;
  CurveReading reading_;
  std::string text_;
  std::optional<CsvRows> rows_;  // of text_
  bool is_guessed_ = false;      // text_: letters beyond ASCII may be wrong
  std::string header_;           // as read, for messages
  std::size_t cell_count_ = 0;
  std::array<std::optional<std::size_t>, kCellKinds> at_;
  std::span<const std::string_view> cells_;
  std::map<std::tuple<std::string, std::string, std::string, std::string>, std::size_t> index_;
};

Result<bool> CurveFile::nextRow() {
  auto there = rows_->next();
  if (!there.ok()) return wrongInput(path_.string(), there.error().message);
  cells_ = rows_->cells();
  return there;
}

Status CurveFile::header() {
  ASSIGN_OR_RETURN(const bool there, nextRow());
  if (!there) return lineError("the file is empty; a header with force_n and depth_m or t_s is expected");
  if (cells_.size() > kMaxCells) return lineError(fmt::format("more than {} columns", kMaxCells));
  header_ = headerText(cells_, rows_->separator());
  cell_count_ = cells_.size();
  for (std::size_t i = 0; i < cells_.size(); ++i)
    for (std::size_t c = 0; c < kCellKinds; ++c)
      if (isColumn(cells_[i], kCellNames[c])) {
        if (at_[c]) return lineError("column " + shown(cells_[i]) + " stands twice in the header");
        at_[c] = i;
      }
  // a fact given twice might be contradictory
  const std::pair<CurveCell, bool> said[] = {{kSpecimenCell, !facts_.specimen.empty()},
                                             {kNeedleCell, !facts_.needle.empty()},
                                             {kTissueCell, !facts_.tissue.empty()},
                                             {kSpeedCell, facts_.speed_mps > 0},
                                             {kDiameterCell, facts_.diameter_m > 0}};
  for (const auto& [column, in_facts] : said)
    if (in_facts && has(column))
      return lineError(
          fmt::format("column '{}': the description gives it too; remove one of them", kCellNames[column]));
  return {};
}

Status CurveFile::open(std::string& missing) {
  ASSIGN_OR_RETURN(auto bytes, readWholeFile(path_, kMaxCurveBytes));
  is_guessed_ = reading_.encoding == TextEncoding::kUnicode && !utf8TextOf({}, bytes).ok();
  ASSIGN_OR_RETURN(text_, utf8TextOf(path_.string(), std::move(bytes),
                                     is_guessed_ ? TextEncoding::kAsciiParts : reading_.encoding));
  rows_.emplace(text_, reading_.lines_above, CommentLines::kYes);
  RETURN_IF_ERROR(header());
  const auto lacks = [&](bool is_missing, std::string_view name) {
    if (is_missing) missing += (missing.empty() ? "" : ", ") + std::string(name);
  };
  lacks(!has(kForceCell), "force_n");
  lacks(!has(kDepthCell) && !has(kTimeCell), "depth_m (or t_s)");
  lacks(!has(kSpeedCell) && facts_.speed_mps == 0 && !(has(kDepthCell) && has(kTimeCell)), "speed_m_s");
  lacks(!has(kSpecimenCell) && facts_.specimen.empty(), "specimen");
  lacks(!has(kNeedleCell) && facts_.needle.empty(), "needle");
  lacks(!has(kTissueCell) && facts_.tissue.empty(), "tissue");
  if (!missing.empty()) missing += "; " + header_;
  return {};
}

Result<double> CurveFile::numberIn(CurveCell column) const {
  const std::string_view cell = cells_[*at_[column]];
  const auto value = csvNumber(cell, rows_->separator());
  if (!value)
    return lineError(fmt::format("column '{}': {} is not a number", kCellNames[column], shown(cell)));
  NumberRange range = kCellRanges[column];
  if (column == kDepthCell && reading_.negate_depth) range = {-range.max, -range.min};
  const bool unit_is_said = column == kForceCell && reading_.force_unit_N > 0;
  const double number = unit_is_said ? *value * reading_.force_unit_N : *value;
  const bool in_range = range.contains(number);
  if (in_range && (unit_is_said || implausible(kCellQuantities[column], number).empty())) return number;
  // the greatest number of the column shows the unit best
  const std::string other_unit = unit_is_said ? "" : implausible(kCellQuantities[column], greatestIn(column));
  return lineError(
      fmt::format("column '{}': {} is {}{}{}{}", kCellNames[column], shown(cell),
                  in_range ? "implausible" : "out of range " + rangeText(range),
                  other_unit.empty() ? "" : "; the greatest is ", other_unit,
                  column == kForceCell && !unit_is_said ? " (--force-unit says what they are)" : ""));
}

double CurveFile::greatestIn(CurveCell column) const {
  double greatest = 0;
  CsvRows rows(text_, reading_.lines_above, CommentLines::kYes);
  for (auto there = rows.next(); there.ok() && *there; there = rows.next()) {
    if (rows.cells().size() <= *at_[column]) continue;
    const double number = csvNumber(rows.cells()[*at_[column]], rows.separator()).value_or(0);
    if (std::abs(number) > std::abs(greatest)) greatest = number;
  }
  return greatest;
}

Status CurveFile::textIn(CurveCell column, const std::string& known, std::string& into) const {
  into = has(column) ? std::string(cells_[*at_[column]]) : known;
  if (!has(column)) return {};
  if (is_guessed_ && !std::all_of(into.begin(), into.end(), [](char c) { return c > 0; }))
    return lineError(
        fmt::format("column '{}': {} is not UTF-8: save the table as \"CSV UTF-8\", or say what it "
                    "is, for example windows-1252 (--encoding)",
                    kCellNames[column], shown(into)));
  if (const Status status = checkNewText(std::string(kCellNames[column]), into, 1, kMaxNameBytes);
      !status.ok())
    return lineError("column " + status.error().message);
  return {};
}

Result<CurvePhase> CurveFile::phaseIn() const {
  if (!has(kPhaseCell)) return CurvePhase::kInsert;
  const std::string_view cell = cells_[*at_[kPhaseCell]];
  const auto* const found = std::find_if(kCurvePhases.begin(), kCurvePhases.end(),
                                         [&](CurvePhase one) { return nameOf(one) == cell; });
  if (found == kCurvePhases.end())
    return lineError(fmt::format("column 'phase': {} is not insert, hold or withdraw", shown(cell)));
  const CurvePhase phase = *found;
  if (phase == CurvePhase::kHold && !has(kTimeCell))
    return lineError("column 'phase': a hold needs a column 't_s', as its force changes with time");
  if (phase == CurvePhase::kWithdraw && !has(kDepthCell))
    return lineError("column 'phase': a withdrawal needs a column 'depth_m'");
  return phase;
}

Status CurveFile::addRow(std::vector<CurveRows>& curves) {
  ForceCurve one;
  RETURN_IF_ERROR(textIn(kCurveCell, {}, one.name));
  RETURN_IF_ERROR(textIn(kSpecimenCell, facts_.specimen, one.specimen));
  RETURN_IF_ERROR(textIn(kNeedleCell, facts_.needle, one.needle));
  RETURN_IF_ERROR(textIn(kTissueCell, facts_.tissue, one.tissue));
  one.speed_mps = facts_.speed_mps;
  one.diameter_m = facts_.diameter_m;
  double depth_m = 0, t_s = 0;
  ASSIGN_OR_RETURN(const CurvePhase phase, phaseIn());
  ASSIGN_OR_RETURN(const double force_N, numberIn(kForceCell));
  if (has(kDepthCell)) {
    ASSIGN_OR_RETURN(depth_m, numberIn(kDepthCell));
  }
  if (has(kTimeCell)) {
    ASSIGN_OR_RETURN(t_s, numberIn(kTimeCell));
  }
  if (has(kSpeedCell)) {
    ASSIGN_OR_RETURN(one.speed_mps, numberIn(kSpeedCell));
  }
  if (has(kDiameterCell)) {
    ASSIGN_OR_RETURN(one.diameter_m, numberIn(kDiameterCell));
  }
  const auto [found, is_new] =
      index_.try_emplace({one.name, one.specimen, one.needle, one.tissue}, curves.size());
  if (is_new) {
    if (curves.size() == kMaxCurves) return lineError(fmt::format("more than {} curves", kMaxCurves));
    curves.emplace_back();
    curves.back().curve = std::move(one);
    curves.back().first_line = rows_->line();
  } else {
    const ForceCurve& first = curves[found->second].curve;
    const auto line = curves[found->second].first_line;
    const auto differs = [&](CurveCell column, double was, double is) {
      return lineError(fmt::format(
          "column '{}': {}, but {} in line {} of the same curve; give each insertion its own name in a "
          "column 'curve', and one speed",
          kCellNames[column], numberText(is), numberText(was), line));
    };
    if (first.speed_mps != one.speed_mps) return differs(kSpeedCell, first.speed_mps, one.speed_mps);
    if (first.diameter_m != one.diameter_m) return differs(kDiameterCell, first.diameter_m, one.diameter_m);
  }
  CurveRows& grown = curves[found->second];
  if (!grown.t_s.empty() && has(kTimeCell) && t_s < grown.t_s.back())
    return lineError(fmt::format("column 't_s': {} comes after {}; time must not go back within a curve",
                                 numberText(t_s), numberText(grown.t_s.back())));
  if (!grown.phases.empty() && phase < grown.phases.back())
    return lineError(fmt::format("column 'phase': '{}' comes after '{}'; the order is insert, hold, withdraw",
                                 nameOf(phase), nameOf(grown.phases.back())));
  grown.phases.push_back(phase);
  grown.curve.force_N.push_back(reading_.negate_force ? -force_N : force_N);
  grown.curve.depth_m.push_back(reading_.negate_depth ? -depth_m : depth_m);
  if (has(kTimeCell)) grown.t_s.push_back(t_s);
  return {};
}

Result<ForceCurve> CurveFile::finished(CurveRows rows) const {
  const std::string inside = rows.curve.name.empty() ? std::string() : ":" + rows.curve.name;
  rows.curve.name = path_.filename().string() + inside;
  rows.where = fmt::format("{} line {}, curve {}", path_.string(), rows.first_line, rows.curve.name);
  rows.has_depth = has(kDepthCell);
  rows.has_phases = has(kPhaseCell);
  rows.digitised = facts_.digitised || reading_.digitised;
  rows.insertion_s = facts_.insertion_s;
  RETURN_IF_ERROR(checkTimeStep(rows.where, rows.t_s));
  const ForceZero zero = zeroOf(rows);
  rows.curve.zero_N = zero.mean_N;
  rows.curve.zero_drift_N = zero.drift_N;
  if (reading_.tare)
    for (std::size_t i = 0; i < zero.at_row_N.size(); ++i) rows.curve.force_N[i] -= zero.at_row_N[i];
  auto curve = curveOf(std::move(rows));
  if (!curve.ok() && !reading_.tare && !zero.at_row_N.empty())
    return Error{curve.error().code,
                 fmt::format("{} (above the skin its force is {:.3g} N: --tare takes that off)",
                             curve.error().message, zero.mean_N)};
  return curve;
}

Result<std::vector<ForceCurve>> CurveFile::read(std::size_t& rows_left) {
  std::vector<CurveRows> grown;
  for (;;) {
    ASSIGN_OR_RETURN(const bool there, nextRow());
    if (!there) break;
    if (rows_left == 0) return lineError(fmt::format("more than {} rows in all files", kMaxCurveRows));
    --rows_left;
    if (cells_.size() != cell_count_)
      return lineError(fmt::format("{} cells, the header has {}", cells_.size(), cell_count_));
    RETURN_IF_ERROR(addRow(grown));
  }
  if (grown.empty()) return lineError("no rows after the header");
  std::vector<ForceCurve> curves;
  for (CurveRows& one : grown) {
    ASSIGN_OR_RETURN(auto curve, finished(std::move(one)));
    curves.push_back(std::move(curve));
  }
  return curves;
}

}  // namespace

Result<CurveFileContent> readCurveFile(const fs::path& path, const CurveFacts& facts,
                                       const CurveReading& reading, std::size_t& rows_left) {
  CurveFile file(path, facts, reading);
  CurveFileContent content;
  if (const Status opened = file.open(content.missing); !opened.ok()) {
    // a text beside the curves need not be a table
    if (!facts.file.empty() || lowerCase(path.extension().string()) != ".txt") return opened.error();
    content.missing = "a table (" + opened.error().message + ")";
  }
  if (!content.missing.empty()) return content;
  ASSIGN_OR_RETURN(content.curves, file.read(rows_left));
  return content;
}

}  // namespace needlelab

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "client/sim/stability/case.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/base/columns.h"

namespace needlelab {

std::string_view verdictText(Verdict verdict) {
  constexpr std::array<std::string_view, 4> kTexts = {"stable", "chatters", "diverges", ""};
  return kTexts[static_cast<std::size_t>(verdict)];
}

std::optional<bool> stepIsNoticeable(const CaseRow& row) {
  if (!row.max_unexplained_step_N) return std::nullopt;
  return *row.max_unexplained_step_N > kNoticeableStep_N;
}

std::vector<AxialModel> modelsOf(const std::vector<CaseRow>& rows) {
  std::vector<AxialModel> models;
  for (const CaseRow& row : rows)
    if (std::find(models.begin(), models.end(), row.model) == models.end()) models.push_back(row.model);
  return models;
}

namespace {

constexpr double kShownAsZero = 1e-9;  // rounding, in any unit of a row
constexpr AxialModel kWall = AxialModel::kEnhancedTrackingWall;
constexpr std::size_t kName = 24, kColumn = 13;

nlohmann::ordered_json orNull(std::optional<double> value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}

std::string column(const std::string& text, std::size_t width) {
  return padded(text + " ", width);
}

std::string cell(const CaseRow* row) {
  if (row == nullptr || !row->applicable) return "";
  const char* mark = row->verdict == Verdict::kChatters   ? " ~"
                     : row->verdict == Verdict::kDiverges ? " !"
                                                          : "";
  return shortNumber(row->measured) + mark;
}

// the wall's notes, notes of another model where the wall has none, and the reasons of failures
bool worthReading(const std::vector<CaseRow>& rows, const CaseRow& row) {
  const CaseRow* wall = rowOf(rows, row.case_name, kWall);
  return wall == nullptr || wall == &row || wall->note.empty() || !row.passed;
}

// cases in which another model measured no more than the wall
std::string noWorse(const std::vector<CaseRow>& rows) {
  std::string text;
  for (const std::string& name : caseNames(rows)) {
    const CaseRow* wall = rowOf(rows, name, kWall);
    if (wall == nullptr || !wall->measured) continue;
    std::string models;
    for (const CaseRow& row : rows)
      if (row.case_name == name && row.model != kWall && row.passed && row.measured &&
          *row.measured <= *wall->measured + 1e-6 * std::abs(*wall->measured))
        models += (models.empty() ? "" : ", ") + std::string(shortName(row.model));
    if (!models.empty()) text += "  " + column(name, kName) + models + "\n";
  }
  return text;
}

// coupled stability and passivity of the wall's closed loops, told apart
std::string marginsText(const std::vector<CaseRow>& rows) {
  std::string text;
  for (const std::string& name : caseNames(rows)) {
    const CaseRow* row = rowOf(rows, name, kWall);
    if (row == nullptr || !row->passive_margin || !row->coupled_margin) continue;
    text += "  " + column(name, kName) + column(shortNumber(row->coupled_margin), kColumn) +
            column(shortNumber(row->passive_margin) + (*row->passive_margin < 1 ? " not" : ""), kColumn) +
            shortNumber(row->grip_energy_J) + "\n";
  }
  if (text.empty()) return text;
  return "\nWhat theory allows over the wall's stiffness: with the case's hand (coupled stability); with the "
         "device's own damping alone (passivity: below 1 the loop is not passive); energy got at the grip "
         "[J]\n" +
         text;
}

std::string controlText(const std::vector<CaseRow>& rows) {
  std::string text;
  for (const std::string& name : caseNames(rows)) {
    const CaseRow* row = rowOf(rows, name, kWall);
    if (row == nullptr || !row->controlled_energy_J) continue;
    text += "  " + column(name, kName) + column(shortNumber(row->grip_energy_J), kColumn) +
            column(shortNumber(row->controlled_energy_J), kColumn) + shortNumber(row->distortion_N) + "\n";
  }
  if (text.empty()) return text;
  return "\nPassivity control (the wall): energy got at the grip without it, with it [J]; force taken off "
         "[N]\n" +
         text;
}

std::string noticeableSteps(const std::vector<CaseRow>& rows) {
  std::string text;
  for (const std::string& name : caseNames(rows)) {
    std::string models;
    for (const CaseRow& row : rows)
      if (row.case_name == name && row.applicable && stepIsNoticeable(row).value_or(false))
        models += (models.empty() ? "" : ", ") + std::string(shortName(row.model)) + " " +
                  shortNumber(row.max_unexplained_step_N);
    if (!models.empty()) text += "  " + column(name, kName) + models + "\n";
  }
  if (text.empty()) return text;
  return fmt::format("\nForce steps that no spring explains and that a hand may notice (above {:g} N) [N]\n",
                     kNoticeableStep_N) +
         text;
}

}  // namespace

std::string_view shortName(AxialModel model) {
  static constexpr std::array<std::string_view, kAxialModelCount> kNames = {
      "wall",        "wall 2018", "direct", "Voigt",   "god object", "first order",
      "statistical", "table",     "FEM",    "Okamura", "Dahl"};
  return kNames[static_cast<std::size_t>(model)];
}

std::string shortNumber(std::optional<double> value) {
  if (!value) return "-";
  if (std::abs(*value) < kShownAsZero) return "0";
  return fmt::format("{:.3g}", *value);
}

std::vector<std::string> caseNames(const std::vector<CaseRow>& rows) {
  std::vector<std::string> names;
  for (const CaseRow& row : rows)
    if (std::find(names.begin(), names.end(), row.case_name) == names.end()) names.push_back(row.case_name);
  return names;
}

const CaseRow* rowOf(const std::vector<CaseRow>& rows, const std::string& case_name, AxialModel model) {
  const auto found = std::find_if(rows.begin(), rows.end(), [&](const CaseRow& row) {
    return row.case_name == case_name && row.model == model;
  });
  return found == rows.end() ? nullptr : &*found;
}

std::string findingOf(const std::vector<CaseRow>& rows) {
  int wall_cases = 0, wall_stable = 0, judged = 0;
  struct Count {
    AxialModel model;
    int bad = 0, all = 0;
  };
  std::vector<Count> others;
  for (const AxialModel model : modelsOf(rows)) {
    Count count{model};
    for (const CaseRow& row : rows) {
      if (row.model != model || !row.applicable) continue;
      ++count.all;
      if (row.verdict != Verdict::kStable) ++count.bad;
    }
    judged += count.all;
    if (model == kWall)
      wall_cases = count.all, wall_stable = count.all - count.bad;
    else if (count.bad > 0)
      others.push_back(count);
  }
  std::stable_sort(others.begin(), others.end(),
                   [](const Count& a, const Count& b) { return a.bad > b.bad; });
  std::string text;
  if (wall_cases > 0)
    text =
        fmt::format("The enhanced tracking wall is stable in {} of {} hard cases", wall_stable, wall_cases);
  if (judged == 0) return "Nothing was judged: these cases say nothing about these models";
  if (others.empty()) return text.empty() ? "All that was asked for is stable" : text;
  text += text.empty() ? "Not stable: " : "; not stable: ";
  for (std::size_t i = 0; i < std::min<std::size_t>(3, others.size()); ++i)
    text += fmt::format("{}{} in {} of {}", i > 0 ? ", " : "", shortName(others[i].model), others[i].bad,
                        others[i].all);
  if (others.size() > 3)
    text += fmt::format(", and {}{} in at most {}", others.size() - 3,
                        others.size() > 4 ? " others" : " other", others[3].bad);
  return text;
}

nlohmann::ordered_json rowsJson(const std::vector<CaseRow>& rows) {
  auto list = nlohmann::ordered_json::array();
  for (const CaseRow& row : rows) {
    const bool judged = row.applicable;
    list.push_back(
        {{"case", row.case_name},
         {"model", axialModelName(row.model)},
         {"applicable", row.applicable},
         {"finite", judged ? nlohmann::ordered_json(row.finite) : nlohmann::ordered_json()},
         {"max_force_n", orNull(row.max_force_N)},
         {"max_unexplained_step_n", orNull(row.max_unexplained_step_N)},
         {"chatter_n", orNull(row.chatter_N)},
         {"step_noticeable",
          stepIsNoticeable(row) ? nlohmann::ordered_json(*stepIsNoticeable(row)) : nlohmann::ordered_json()},
         {"energy_j", orNull(row.energy_J)},
         {"coupled_margin", orNull(row.coupled_margin)},
         {"passive_margin", orNull(row.passive_margin)},
         {"grip_energy_j", orNull(row.grip_energy_J)},
         {"controlled_energy_j", orNull(row.controlled_energy_J)},
         {"distortion_n", orNull(row.distortion_N)},
         {"measured", orNull(row.measured)},
         {"limit", orNull(row.limit)},
         {"passed", judged ? nlohmann::ordered_json(row.passed) : nlohmann::ordered_json()},
         {"verdict", judged ? nlohmann::ordered_json(verdictText(row.verdict)) : nlohmann::ordered_json()},
         {"quantity", row.quantity},
         {"note", row.note}});
  }
  return list;
}

std::string rowsText(const std::vector<CaseRow>& rows) {
  const auto models = modelsOf(rows);
  std::string text = column("", kName) + column("limit", kColumn);
  for (const AxialModel model : models) text += column(std::string(shortName(model)), kColumn);
  text += "measured\n";
  for (const std::string& name : caseNames(rows)) {
    std::optional<double> limit;
    std::string line, quantity;
    for (const AxialModel model : models) {
      const CaseRow* row = rowOf(rows, name, model);
      line += column(cell(row), kColumn);
      if (row == nullptr || !row->applicable) continue;
      if (!limit) limit = row->limit;
      if (quantity.empty()) quantity = row->quantity;
    }
    text += column(name, kName) + column(shortNumber(limit), kColumn) + line + quantity + "\n";
  }
  text +=
      "no mark: stable; ~ chatters: bounded, but over the limit (or its second condition, see below); ! "
      "diverges: grows, or only the gate holds it\n";
  std::string notes;
  for (const CaseRow& row : rows)
    if (row.applicable && !row.note.empty() && worthReading(rows, row))
      notes += "  " + column(row.case_name, kName) + column(std::string(shortName(row.model)), kColumn) +
               row.note + "\n";
  if (!notes.empty()) text += "\nNotes\n" + notes;
  text += marginsText(rows) + controlText(rows) + noticeableSteps(rows);
  if (const std::string same = noWorse(rows); !same.empty())
    text += "\nPassed, and measured no more than the enhanced tracking wall\n" + same;
  return text + "\n" + findingOf(rows) + ".\n";
}

}  // namespace needlelab

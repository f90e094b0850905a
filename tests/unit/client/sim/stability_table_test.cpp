// What `needlelab-sim stability` prints for rows made by the test.
#include <gmock/gmock.h>

#include <cmath>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"

namespace needlelab {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

constexpr AxialModel kWall = AxialModel::kEnhancedTrackingWall;

CaseRow judgedRow(const std::string& case_name, AxialModel model, double measured, double limit,
                  Verdict verdict, const std::string& quantity = "force [N]", const std::string& note = "") {
  CaseRow row;
  row.case_name = case_name;
  row.model = model;
  row.applicable = row.finite = true;
  row.measured = measured;
  row.limit = limit;
  row.quantity = quantity;
  row.verdict = verdict;
  row.passed = verdict == Verdict::kStable;
  row.note = note;
  return row;
}

CaseRow unjudgedRow(const std::string& case_name, AxialModel model) {
  CaseRow row;
  row.case_name = case_name;
  row.model = model;
  return row;
}

// the cells of a line: 24 characters for the case, 15 for each number
std::string line(const std::vector<std::string>& cells, const std::string& last) {
  std::string text;
  for (std::size_t i = 0; i < cells.size(); ++i)
    text += cells[i] + std::string((i == 0 ? 24 : 15) - cells[i].size(), ' ');
  return text + last;
}

std::vector<std::string> linesOf(const std::string& text) {
  std::istringstream all(text);
  std::vector<std::string> lines;
  for (std::string one; std::getline(all, one);) lines.push_back(one);
  return lines;
}

TEST(ShortNumber, hasThreeDigitsAndCallsRoundingZero) {
  const struct {
    std::optional<double> value;
    const char* text;
  } rows[] = {{{}, "-"},
              {0.0, "0"},
              {9.9e-10, "0"},
              {-9.9e-10, "0"},
              {1.1e-9, "1.1e-09"},
              {0.12345, "0.123"},
              {-0.12355, "-0.124"},
              {999.4, "999"},
              {12345.678, "1.23e+04"},
              {1.0, "1"},
              {std::nan(""), "nan"},
              {INFINITY, "inf"}};
  for (const auto& row : rows) EXPECT_EQ(shortNumber(row.value), row.text);
}

TEST(StabilityTable, hasALineForEachCaseAndAColumnForEachModel) {
  const std::vector<CaseRow> rows = {
      judgedRow("hold", kWall, 0.0123456, 0.05, Verdict::kStable, "force [N]", "of the wall"),
      judgedRow("hold", AxialModel::kDirect, 0.5, 0.05, Verdict::kChatters),
      judgedRow("hold", AxialModel::kFem, 12345.678, 0.05, Verdict::kDiverges, "force [N]", "swells"),
      judgedRow("slip", kWall, -0.2, 0, Verdict::kStable, "energy [J]"),
      judgedRow("slip", AxialModel::kDirect, -0.2, 0, Verdict::kStable, "energy [J]", "of direct"),
      unjudgedRow("slip", AxialModel::kFem)};
  const std::string text = rowsText(rows);
  const auto lines = linesOf(text);
  ASSERT_GT(lines.size(), 3u);
  EXPECT_EQ(lines[0], line({"", "limit", "wall", "direct", "FEM"}, "measured"));
  EXPECT_EQ(lines[1], line({"hold", "0.05", "0.0123", "0.5 ~", "1.23e+04 !"}, "force [N]"));
  EXPECT_EQ(lines[2], line({"slip", "0", "-0.2", "-0.2", ""}, "energy [J]"));
  EXPECT_THAT(text, HasSubstr("\n\nNotes\n  " + line({"hold", "wall"}, "of the wall") + "\n  " +
                              line({"hold", "FEM"}, "swells") + "\n  " +
                              line({"slip", "direct"}, "of direct") + "\n"));
  EXPECT_THAT(text,
              EndsWith("\n\nThe enhanced tracking wall is stable in 2 of 2 hard cases; not stable: direct "
                       "in 1 of 2, FEM in 1 of 1.\n"));
}

// 14 of 30: Wilson's interval is 30.2 to 63.9 %
TEST(StabilityTable, ofANeighbourhoodShowsTheShareThatIsStableWithItsInterval) {
  CaseRow row = judgedRow("late", kWall, 16.0 / 30, 0.25, Verdict::kChatters, "neighbours that stay stable");
  row.neighbours = NeighbourCount{14, 30};
  const auto lines = linesOf(rowsText({row}));
  ASSERT_GT(lines.size(), 1u);
  EXPECT_EQ(lines[1], line({"late", "75 %", "47 % 30-64 ~"}, "neighbours that stay stable"));
}

TEST(StabilityTable, aNoteOfAModelThatPassedGivesWayToTheWalls) {
  const std::string text =
      rowsText({judgedRow("hold", kWall, 0.1, 1, Verdict::kStable, "force [N]", "of the wall"),
                judgedRow("hold", AxialModel::kVoigt, 0.2, 1, Verdict::kStable, "force [N]", "of Voigt")});
  EXPECT_THAT(text, HasSubstr("of the wall"));
  EXPECT_THAT(text, Not(HasSubstr("of Voigt")));
}

TEST(StabilityTable, tellsCoupledStabilityFromPassivity) {
  CaseRow hold = judgedRow("hold", kWall, 0.1, 1, Verdict::kStable),
          open = judgedRow("open", kWall, 0.1, 1, Verdict::kStable);
  hold.coupled_margin = 4.667;
  hold.passive_margin = 0.667;
  hold.grip_energy_J = 0.0012;
  open.coupled_margin = open.passive_margin = 2.5;
  open.grip_energy_J = 0;
  const CaseRow prescribed = judgedRow("prescribed", kWall, 0.1, 1, Verdict::kStable);
  const std::string text = rowsText({hold, open, prescribed});
  EXPECT_THAT(text,
              HasSubstr("energy got at the grip [J]\n  " + line({"hold", "4.67", "0.667 not"}, "0.0012") +
                        "\n  " + line({"open", "2.5", "2.5"}, "0") + "\n"));
  EXPECT_EQ(text.find("prescribed"), text.rfind("prescribed")) << "no margins: the table alone names it";
}

// 20.8 mN: the noticeable step for a held pen (Lee and Hannaford 2003)
TEST(StabilityTable, listsTheStepsThatAHandMayNotice) {
  CaseRow wall = judgedRow("hold", kWall, 0.1, 1, Verdict::kStable);
  CaseRow direct = judgedRow("hold", AxialModel::kDirect, 0.1, 1, Verdict::kStable);
  wall.max_unexplained_step_N = 0.0207;
  direct.max_unexplained_step_N = 0.021;
  EXPECT_EQ(stepIsNoticeable(wall), false);
  EXPECT_EQ(stepIsNoticeable(direct), true);
  EXPECT_EQ(stepIsNoticeable(judgedRow("hold", kWall, 0.1, 1, Verdict::kStable)), std::nullopt);
  EXPECT_THAT(rowsText({wall, direct}),
              HasSubstr("(above 0.0208 N) [N]\n  " + line({"hold"}, "direct 0.021") + "\n"));
  EXPECT_THAT(rowsText({wall}), Not(HasSubstr("may notice")));
}

TEST(StabilityTable, columnsCountCharactersAndNotBytes) {
  const auto lines = linesOf(rowsText({judgedRow("grün", kWall, 1, 2, Verdict::kStable)}));
  ASSERT_GT(lines.size(), 1u);
  EXPECT_EQ(lines[1].find("2"), 24u + 1) << "ü has two bytes";
}

TEST(StabilityFinding, countsTheModelsThatAreNotStable) {
  // this many of three cases in which the model is not stable
  const auto ofThree = [](AxialModel model, int bad) {
    std::vector<CaseRow> rows;
    for (int i = 0; i < 3; ++i)
      rows.push_back(
          judgedRow("case " + std::to_string(i), model, 1, 1,
                    i < bad ? (i == 0 ? Verdict::kChatters : Verdict::kDiverges) : Verdict::kStable));
    return rows;
  };
  using Counts = std::vector<std::pair<AxialModel, int>>;
  constexpr AxialModel kOld = AxialModel::kTrackingWall, kDirect = AxialModel::kDirect,
                       kVoigt = AxialModel::kVoigt, kGod = AxialModel::kGodObject, kFem = AxialModel::kFem;
  const std::string wall = "The enhanced tracking wall is stable in ";
  const struct {
    Counts bad;
    std::string text;
  } findings[] = {
      {{}, "Nothing was judged: these cases say nothing about these models"},
      {{{kWall, 0}}, wall + "3 of 3 hard cases"},
      {{{kWall, 1}}, wall + "2 of 3 hard cases"},
      {{{kVoigt, 0}, {kFem, 0}}, "All that was asked for is stable"},
      {{{kVoigt, 0}, {kFem, 2}}, "Not stable: FEM in 2 of 3"},
      {{{kWall, 0}, {kDirect, 1}, {kFem, 3}},
       wall + "3 of 3 hard cases; not stable: FEM in 3 of 3, direct in 1 of 3"},
      {{{kOld, 2}, {kDirect, 2}, {kVoigt, 3}, {kGod, 2}},
       "Not stable: Voigt in 3 of 3, wall 2018 in 2 of 3, direct in 2 of 3, and 1 other in at most 2"},
      {{{kOld, 1}, {kDirect, 2}, {kVoigt, 3}, {kGod, 2}, {kFem, 1}},
       "Not stable: Voigt in 3 of 3, direct in 2 of 3, god object in 2 of 3, and 2 others in at most 1"}};
  for (const auto& finding : findings) {
    std::vector<CaseRow> rows = {unjudgedRow("another", kWall), unjudgedRow("another", kFem)};
    for (const auto& [model, bad] : finding.bad) {
      const auto more = ofThree(model, bad);
      rows.insert(rows.end(), more.begin(), more.end());
    }
    EXPECT_EQ(findingOf(rows), finding.text);
  }
}

}  // namespace
}  // namespace needlelab

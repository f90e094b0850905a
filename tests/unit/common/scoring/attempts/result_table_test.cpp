#include "common/scoring/attempts/result_table.h"

#include <gtest/gtest.h>

#include <numbers>
#include <string>

#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

/// Two exercises; anna passed the first one, and used up the second one.
pb::Results results() {
  pb::Results page;
  for (const char* id : {"first", "second"}) page.add_exercise_ids(id);
  page.add_exercise_names("Knee, from the side");
  page.add_exercise_names("Shoulder");
  for (const char* name : {"peak_force_n", "target_distance_m", "injected_in_target_share", "entries"})
    page.add_required_measures(name);
  auto& anna = *page.add_rows();
  anna.set_trainee("anna");
  anna.set_full_name("Köhler; Anna");
  for (const char* group : {"autumn-a", "spring"}) anna.add_groups(group);
  auto& first = *anna.add_cells();
  first.set_exercise_id("first");
  first.set_attempts(3);
  first.set_passed(true);
  first.mutable_best()->set_number(2);
  first.mutable_best()->set_started_unix_ns(20635LL * 86'400'000'000'000 + 3'600'999'999'999);
  first.mutable_best()->set_score_json(
      R"([{"measure":"entries","value":1.0,"unit":"","words":""},)"
      R"({"measure":"peak_force_n","value":3.25,"unit":"N","max":5.0,"passed":true,"words":""},)"
      R"({"measure":"target_distance_m","value":0.0031,"unit":"m","words":""},)"
      R"({"measure":"injected_in_target_share","value":null,"unit":"","words":""},)"
      R"({"measure":"sparc","value":-2.5,"unit":"","words":"not asked for"}])");
  auto& second = *anna.add_cells();
  second.set_exercise_id("second");
  second.set_attempts(1);
  second.set_passed(false);
  second.set_attempts_left(0);
  return page;
}

std::string tableOf(const pb::Results& page, const char* separator) {
  ResultTable table(*csvStyleOf(separator));
  std::string text;
  table.begin(text, page);
  for (const auto& person : page.rows())
    for (const auto& cell : person.cells()) EXPECT_TRUE(table.add(text, person, cell).ok());
  return text;
}

TEST(ResultTable, hasARowForEachPersonAndExerciseWithUnits) {
  EXPECT_EQ(
      tableOf(results(), "comma"),
      "\xef\xbb\xbfPerson,Full name,Groups,Exercise,Verdict,Attempts,Attempts left,Best attempt,"
      "Date of best attempt (UTC),Peak force [N],Distance from the target's centre at the deepest point [mm],"
      "Share of the injection in the target [%],Entries\r\n"
      "anna,Köhler; Anna,autumn-a; spring,\"Knee, from the side\",passed,3,,2,2026-07-01 01:00:00,"
      "3.25,3.1,,1\r\n"
      "anna,Köhler; Anna,autumn-a; spring,Shoulder,not passed,1,0,,,,,,\r\n");
}

TEST(ResultTable, hasDecimalCommasBetweenSemicolons) {
  const std::string text = tableOf(results(), "semicolon");
  EXPECT_NE(text.find("anna;\"Köhler; Anna\";\"autumn-a; spring\";Knee, from the side;passed;3;;2;"
                      "2026-07-01 01:00:00;3,25;3,1;;1\r\n"),
            std::string::npos)
      << text;
  EXPECT_NE(tableOf(results(), "tab")
                .find("anna\tKöhler; Anna\tautumn-a; spring\tKnee, from the side\tpassed\t3\t"),
            std::string::npos);
}

TEST(ResultTable, theVerdictStatesWhatIsKnown) {
  const auto verdict = [](const pb::ResultCell& cell) {
    ResultTable table(*csvStyleOf("comma"));
    std::string text;
    EXPECT_TRUE(table.add(text, {}, cell).ok());
    return text.substr(4, text.find(',', 4) - 4);
  };
  pb::ResultCell cell;
  EXPECT_EQ(verdict(cell), "not tried");
  cell.add_locked_by("first");
  EXPECT_EQ(verdict(cell), "not tried");
  cell.set_excused(2);
  EXPECT_EQ(verdict(cell), "excused") << "all attempts";
  cell.set_attempts(1);
  EXPECT_EQ(verdict(cell), "no verdict") << "not scored yet, or nothing is asked for";
  cell.set_passed(false);
  EXPECT_EQ(verdict(cell), "not passed");
  cell.set_passed(true);
  EXPECT_EQ(verdict(cell), "passed");
}

TEST(ResultTable, aLaterPageKeepsTheColumnsOfTheFirst) {
  ResultTable table(*csvStyleOf("comma"));
  std::string text;
  pb::Results page = results();
  table.begin(text, page);
  text.clear();
  // the course was changed in the meantime
  page.mutable_rows(0)->mutable_cells(0)->set_exercise_id("third");
  EXPECT_TRUE(table.add(text, page.rows(0), page.rows(0).cells(0)).ok());
  EXPECT_EQ(text, "anna,Köhler; Anna,autumn-a; spring,third,passed,3,,2,2026-07-01 01:00:00,3.25,3.1,,1\r\n");
  const std::string before = text;
  page.mutable_rows(0)->mutable_cells(0)->mutable_best()->set_score_json("no score");
  EXPECT_EQ(table.add(text, page.rows(0), page.rows(0).cells(0)).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(text, before);
}

TEST(ResultTable, eachMeasureHasOneUnitForItsColumn) {
  // consistent with other texts below 1 m, 1 m/s and 1 J
  for (const MeasureKind& kind : measureKinds()) {
    if (kind.name.find('K') != std::string_view::npos || kind.name.ends_with("_share")) continue;
    const ShownUnit column = columnUnitOf(kind.name);
    const std::string shown = valueText(0.5, std::string(kind.unit));
    std::string unit(column.name);
    EXPECT_EQ(shown.substr(shown.size() - unit.size()), unit) << kind.name;
    const double number = std::stod(shown);
    EXPECT_NEAR(number, 0.5 * column.per_si, 0.05 * number) << kind.name;
  }
  EXPECT_EQ(columnUnitOf("peak_force_layer_3_n").name, "N");
  EXPECT_EQ(columnUnitOf("injected_share").name, "%");
  EXPECT_DOUBLE_EQ(columnUnitOf("injected_share").per_si, 100);
  EXPECT_DOUBLE_EQ(columnUnitOf("planned_angle_error_rad").per_si * std::numbers::pi, 180);
  EXPECT_EQ(columnUnitOf("of_a_later_program").name, "");
}

}  // namespace
}  // namespace needlelab

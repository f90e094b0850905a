// The console knows which measures have a role, a form or a need from client/web/app/lib/measure_rows.js.
// This test makes that file from the table of measures: NEEDLELAB_WRITE_MEASURES=1 bin/scoring_test
// --gtest_filter='Console*'
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "common/scoring/measures/measure_table.h"

namespace needlelab {
namespace {

constexpr const char* kRoleNames[kMeasureRoleCount] = {"",       "time",     "force",        "speed",
                                                       "depth",  "own_line", "planned_line", "target",
                                                       "hazard", "bone",     "hub",          "expert_path"};

template <typename F>
std::string measuresWhere(const char* key, const F& is_so) {
  std::string names;
  for (const MeasureKind& kind : measureKinds())
    if (is_so(kind)) names += fmt::format("{}'{}'", names.empty() ? "" : ", ", kind.name);
  return fmt::format("  {}: [{}],\n", key, names);
}

std::string measuresModule() {
  std::string text =
      "// Measures by what pages look for them. Made by scoring_test from "
      "common/scoring/measures/measure_rows.cpp;\n"
      "// not to be edited (tests/unit/common/scoring/measures/console_measures_test.cpp).\n"
      "// prettier-ignore\nexport const kMeasures = {\n";
  for (std::size_t i = 1; i < kMeasureRoleCount; ++i)
    text += fmt::format("  {}: '{}',\n", kRoleNames[i], measureOf(static_cast<MeasureRole>(i)).name);
  text += measuresWhere("shares", [](const MeasureKind& kind) { return kind.form == MeasureForm::kShare; });
  text +=
      measuresWhere("yes_or_no", [](const MeasureKind& kind) { return kind.form == MeasureForm::kYesNo; });
  text += measuresWhere("need_plan", [](const MeasureKind& kind) { return kind.need == MeasureNeed::kPlan; });
  return text + "};\n";
}

TEST(ConsoleMeasures, areThoseOfTheRows) {
  const std::string path = NEEDLELAB_SOURCE_DIR "/client/web/app/lib/measure_rows.js";
  if (std::getenv("NEEDLELAB_WRITE_MEASURES") != nullptr) std::ofstream(path) << measuresModule();
  std::stringstream found;
  found << std::ifstream(path).rdbuf();
  EXPECT_EQ(found.str(), measuresModule()) << "make it again, see above";
}

TEST(MeasureTable, oneMeasureHasEachRoleAndAPlace) {
  for (std::size_t i = 1; i < kMeasureRoleCount; ++i) {
    const auto role = static_cast<MeasureRole>(i);
    const auto kinds = measureKinds();
    EXPECT_EQ(
        std::count_if(kinds.begin(), kinds.end(), [&](const MeasureKind& kind) { return kind.role == role; }),
        1)
        << kRoleNames[i];
    EXPECT_EQ(roleOf(measureOf(role).name), role);
  }
  EXPECT_EQ(roleOf("no such thing"), MeasureRole::kNone);
  const std::vector<std::string_view> lists = {"elapsed_s",         "peak_force_n",
                                               "greatest_depth_m",  "largest_lateral_error_m",
                                               "target_distance_m", "hazards_touched"};
  EXPECT_EQ(measuresIn(&MeasureKind::in_lists), lists);
  const std::vector<std::string_view> reports = {"elapsed_s",
                                                 "peak_force_n",
                                                 "largest_lateral_error_m",
                                                 "planned_entry_error_m",
                                                 "planned_angle_error_rad",
                                                 "mean_planned_line_error_m",
                                                 "target_distance_m",
                                                 "tissue_damage_m2",
                                                 "dtw_distance_m"};
  EXPECT_EQ(measuresIn(&MeasureKind::in_reports), reports);
}

}  // namespace
}  // namespace needlelab

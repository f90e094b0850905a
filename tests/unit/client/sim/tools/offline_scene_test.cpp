#include "client/sim/tools/offline_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "client/sim/tools/run_table.h"

namespace needlelab {
namespace {

std::vector<std::string> cells(std::string text) {
  std::vector<std::string> found(1);
  for (const char c : text)
    if (c == ',')
      found.emplace_back();
    else if (c != '\n')
      found.back() += c;
  return found;
}

TEST(OfflineScene, everyCellOfTheOutputIsUnderItsHeader) {
  StepReport report;
  report.wrench_W = {{1, 2, 3}, {4, 5, 6}};
  report.p_wall_W_m = {7, 8, 9};
  report.phase = Phase::kWithdrawing;
  report.layer = 3;
  report.depth_m = 0.01;
  report.insertion_m = 0.02;
  report.lateral_error_m = 0.001;
  report.cutting_N = -11;
  report.attracted_N = 12;
  report.friction_N = 13;
  report.puncture_N = -14;
  report.clamping_N = 15;
  std::string row;
  appendRunRow(row, 0.5, report, 0.06);
  EXPECT_EQ(row.back(), '\n');
  const auto names = cells(std::string(runHeader())), values = cells(row);
  ASSERT_EQ(names.size(), values.size());
  const auto at = [&](const std::string& name) {
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? std::string("missing")
                                : values[static_cast<std::size_t>(found - names.begin())];
  };
  const std::pair<const char*, double> expected[] = {{"t_s", 0.5},          {"fx_n", 1},
                                                     {"fy_n", 2},           {"fz_n", 3},
                                                     {"tx_nm", 4},          {"ty_nm", 5},
                                                     {"tz_nm", 6},          {"wx_m", 7},
                                                     {"wy_m", 8},           {"wz_m", 9},
                                                     {"layer", 3},          {"depth_m", 0.01},
                                                     {"insertion_m", 0.02}, {"lateral_error_m", 0.001},
                                                     {"cutting_n", -11},    {"attracted_n", 12},
                                                     {"friction_n", 13},    {"puncture_n", -14},
                                                     {"clamping_n", 15}};
  for (const auto& [name, value] : expected) EXPECT_EQ(std::strtod(at(name).c_str(), nullptr), value) << name;
  EXPECT_EQ(at("phase"), "WITHDRAWING");
  EXPECT_NEAR(std::strtod(at("alpha_rad").c_str(), nullptr), std::atan(0.04 / 0.08), 1e-15);
}

TEST(OfflineScene, aFreeTickHasNoWallAndFortyFiveDegrees) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  StepReport report;
  report.p_wall_W_m = {nan, nan, nan};
  std::string row;
  appendRunRow(row, 0, report, 0.06);
  const auto values = cells(row);
  for (int i = 7; i < 10; ++i) EXPECT_EQ(values[static_cast<std::size_t>(i)], "nan");
  EXPECT_EQ(values[10], "FREE");
  EXPECT_EQ(values[11], "-1");
  EXPECT_NEAR(std::strtod(values[14].c_str(), nullptr), M_PI / 4, 1e-15);
}

TEST(Fnv1a, hasItsPublishedValues) {
  EXPECT_EQ(fnv1a(""), 0xcbf29ce484222325u);
  EXPECT_EQ(fnv1a("a"), 0xaf63dc4c8601ec8cu);
  EXPECT_EQ(fnv1a("foobar"), 0x85944171f73967e8u);
}

}  // namespace
}  // namespace needlelab

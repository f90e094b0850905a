// Checks the figures against section IV of the paper: the numbers below are the paper's.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "client/sim/figures.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/text/csv.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

// The columns of a figure's table, parsed from its text.
class Table {
 public:
  Table(const Figure& figure, const std::vector<std::string>& columns) {
    const test::TempFolder folder;
    auto table = readCsv(folder.write("f.csv", figure.csv), columns);
    if (!table.ok()) throw std::runtime_error(table.error().message);
    table_ = *std::move(table);
  }
  [[nodiscard]] std::size_t rows() const { return table_.rows(); }
  double at(const char* column, std::size_t row) const {
    return table_.columns[static_cast<std::size_t>(table_.find(column))][row];
  }
  // Returns the values of a column in the rows that `wanted` accepts.
  [[nodiscard]] std::vector<double> where(const char* column,
                                          const std::function<bool(std::size_t)>& wanted) const {
    std::vector<double> found;
    for (std::size_t i = 0; i < rows(); ++i)
      if (wanted(i)) found.push_back(at(column, i));
    return found;
  }
  [[nodiscard]] std::vector<double> between(const char* column, double from_s, double to_s) const {
    return where(column, [&](std::size_t i) { return at("t_s", i) >= from_s && at("t_s", i) < to_s; });
  }

 private:
  CsvTable table_;
};

double least(const std::vector<double>& v) {
  return *std::min_element(v.begin(), v.end());
}
double greatest(const std::vector<double>& v) {
  return *std::max_element(v.begin(), v.end());
}

TEST(Figure07, oneNewtonInDecayInTheStopHalfANewtonOut) {
  const auto run = runOneLayer();
  ASSERT_TRUE(run.ok()) << run.error().message;
  const Table t(figure07(*run), {"t_s", "z_m", "force_z_n", "rendered_force_z_n", "depth_m"});

  // free motion: no force
  EXPECT_EQ(greatest(t.between("force_z_n", 22, 23.9)), 0);
  EXPECT_EQ(least(t.between("force_z_n", 22, 23.9)), 0);
  // insertion, 24 to 27 s: up to 1 N ± 2 %, with a lasting plateau
  EXPECT_NEAR(greatest(t.between("force_z_n", 24, 27)), 1, 0.02);
  EXPECT_NEAR(least(t.between("force_z_n", 24.8, 26.8)), 1, 0.02);
  // intentional stop, 27 to 29.5 s: the force falls throughout (except for the tremor) and ends at zero
  double before = 1.001;
  for (double from = 27; from < 29.4; from += 0.2) {
    const double now = greatest(t.between("force_z_n", from, from + 0.2));
    EXPECT_LE(now, before + 0.01) << from;
    before = now;
  }
  EXPECT_LE(greatest(t.between("force_z_n", 29.2, 29.5)), 0.02);
  EXPECT_GE(least(t.between("force_z_n", 27, 29.5)), -0.02);
  // withdrawal, 29.5 to 31.5 s: 0.5 N inwards
  EXPECT_NEAR(least(t.between("force_z_n", 29.5, 31.5)), -0.5, 0.01);
  EXPECT_NEAR(greatest(t.between("force_z_n", 30.2, 31.2)), -0.5, 0.01);
  // free again
  EXPECT_LT(greatest(t.between("depth_m", 31.8, 33)), 0);
  EXPECT_EQ(least(t.between("force_z_n", 31.8, 33)), 0);
  // The gate did not limit the force: the hand got the engine's force, apart from the slew limit at the exit.
  for (std::size_t i = 0; i < t.rows(); ++i)
    ASSERT_NEAR(t.at("force_z_n", i), t.at("rendered_force_z_n", i), 1e-6) << t.at("t_s", i);
}

TEST(Figure09, sixPlateausInAndFourTenthsOut) {
  const auto run = runSixLayers();
  ASSERT_TRUE(run.ok()) << run.error().message;
  const Table t(figure09(*run), {"t_s", "cutting_force_n", "attracted_force_n", "layer", "depth_m"});
  const double forces[] = {1, 2, 1.5, 2.5, 3, 4};
  for (int layer = 0; layer < 6; ++layer) {
    // the way in through this layer: from its first tick to the next layer's first tick, or to the deepest
    // tick
    std::size_t first = 0;
    while (t.at("layer", first) != layer) ++first;
    std::size_t last = first;
    while (last + 1 < t.rows() && t.at("layer", last + 1) == layer &&
           t.at("depth_m", last + 1) >= t.at("depth_m", last) - 1e-5)
      ++last;
    ASSERT_GT(last - first, 40u) << "layer " << layer + 1;
    for (std::size_t i = first + (last - first) / 2; i < last; ++i)
      ASSERT_NEAR(t.at("cutting_force_n", i), forces[layer], 0.02 * forces[layer]) << "layer " << layer + 1;
  }
  EXPECT_NEAR(least(t.between("attracted_force_n", 0, 2)), -0.4, 0.008);
  EXPECT_NEAR(greatest(t.between("attracted_force_n", 1.0, 1.3)), -0.4, 0.008);
  // in by 0.75 s, out by 1.5 s; only one of the two forces at a time
  EXPECT_GT(greatest(t.between("depth_m", 0.5, 0.8)), 0.045);
  EXPECT_LT(greatest(t.between("depth_m", 1.5, 2)), 0);
  for (std::size_t i = 0; i < t.rows(); ++i)
    ASSERT_TRUE(t.at("cutting_force_n", i) == 0 || t.at("attracted_force_n", i) == 0) << i;
}

TEST(Figure08, theWallFollowsAlongEveryAxisAtTheDistanceOfTheForce) {
  const auto run = runSixLayers();
  ASSERT_TRUE(run.ok());
  const Figure figure = figure08(*run);
  const Table t(figure, {"t_s", "px_m", "py_m", "pz_m"});
  for (const char* axis : {"px_m", "py_m", "pz_m"})
    EXPECT_GT(greatest(t.between(axis, 0, 0.75)) - least(t.between(axis, 0, 0.75)), 0.015) << axis;
  // K_t = 500 N/m: the difference distance is 2 mm per newton
  std::size_t seen = 0;
  for (const ChainTick& tick : run->ticks) {
    if (tick.report.phase == Phase::kFree) continue;
    const double axial = std::abs(tick.report.cutting_N + tick.report.attracted_N);
    ASSERT_NEAR(norm(tick.X_WT.p - tick.report.p_wall_W_m), axial / 500, 2e-4);
    ++seen;
  }
  EXPECT_GT(seen, 1000u);
}

TEST(Figure10, theForcePullsBackToTheTrajectoryWhichChangesInTheEnd) {
  const auto run = runClamping();
  ASSERT_TRUE(run.ok()) << run.error().message;
  double deepest_first = 0, shallowest_between = 1, nearest = 1;
  bool turned = false, gave_up = false;
  int entries = 0;
  const Vec3 target{0.008, 0, -0.036};
  double angle = 0;
  for (const ChainTick& tick : run->ticks) {
    const StepReport& r = tick.report;
    entries += (r.flags & kFlagEntry) != 0;
    gave_up = gave_up || (deepest_first > 0.03 && r.insertion_m < 0.6 * deepest_first);
    turned = turned || (gave_up && (r.flags & kFlagTurn) != 0);
    if (!turned && r.phase != Phase::kFree) {
      if (r.insertion_m > deepest_first) deepest_first = r.insertion_m, shallowest_between = 1;
      shallowest_between = std::min(shallowest_between, r.insertion_m);
    }
    if (turned) nearest = std::min(nearest, norm(tick.X_WT.p - target));
    // eq. 8 up to the limit, 1.5 N in this scene
    ASSERT_NEAR(r.clamping_N, std::min(1.5, r.clamping_stiffness_N_per_m * r.lateral_error_m), 1e-9);
    ASSERT_NEAR(norm(r.wrench_W.force_N), r.clamping_N, 1e-9);
    angle = std::max(angle, r.lateral_error_m);
  }
  EXPECT_EQ(entries, 1);           // drawn back, but not completely
  EXPECT_GT(deepest_first, 0.03);  // point 1
  EXPECT_LT(shallowest_between, 0.016);
  EXPECT_GT(shallowest_between, 0.005);
  EXPECT_TRUE(turned);
  EXPECT_LT(nearest, 0.003);  // point 2, the target's radius
  EXPECT_GT(angle, 0.003);
}

// The paper's text: the start is the insertion; the user gives up at 1, changes the trajectory at 2, and then
// reaches the target.
TEST(Figure10, theMarksAreThoseOfThePapersText) {
  const auto run = runClamping();
  ASSERT_TRUE(run.ok()) << run.error().message;
  std::size_t turn = 0;
  while (run->ticks[turn].report.insertion_m < 0.03) ASSERT_LT(++turn, run->ticks.size());
  while (run->ticks[turn].report.insertion_m > 0.02) ASSERT_LT(++turn, run->ticks.size());  // drawn back
  while ((run->ticks[turn].report.flags & kFlagTurn) == 0) ASSERT_LT(++turn, run->ticks.size());
  const auto variable = [](const Figure& figure, const std::string& name) {
    for (const auto& [key, value] : figure.variables)
      if (key == name) return value;
    ADD_FAILURE() << "no " << name;
    return figure.variables.front().second;
  };
  const Vec3 p = run->ticks[turn].X_WT.p;
  EXPECT_EQ(std::get<std::vector<double>>(variable(figure10(*run), "point2")),
            (std::vector<double>{p.x * 1000, p.y * 1000, p.z * 1000}));
  const Figure over_time = figure11(*run);
  const double start_s = std::get<double>(variable(over_time, "start_s"));
  const double gives_up_s = std::get<double>(variable(over_time, "point1_s"));
  const double turns_s = std::get<double>(variable(over_time, "point2_s"));
  EXPECT_LT(start_s, gives_up_s);
  EXPECT_LT(gives_up_s, turns_s);
  EXPECT_DOUBLE_EQ(turns_s, run->time_s(turn));
  EXPECT_LT(turns_s, std::get<double>(variable(over_time, "target_s")));
}

TEST(Figures, thoseWhoseScenesAreSetByHandSaySo) {
  const auto six = runSixLayers(), clamping = runClamping();
  ASSERT_TRUE(six.ok() && clamping.ok());
  for (const Figure& figure : {figure08(*six), figure09(*six), figure10(*clamping), figure11(*clamping)}) {
    std::string scene;
    for (const auto& [key, value] : figure.variables)
      if (key == "scene") scene = std::get<std::string>(value);
    EXPECT_THAT(scene, testing::HasSubstr("simulated hand")) << figure.name;
    EXPECT_THAT(scene, testing::HasSubstr("set by hand")) << figure.name;
  }
}

TEST(Figure11, theForceStartsSmallRisesWithDepthAndFallsOnWithdrawal) {
  const auto run = runClamping();
  ASSERT_TRUE(run.ok());
  const Table t(figure11(*run), {"t_s", "clamping_n", "insertion_m", "turning", "stiffness_n_per_m"});
  // At small depth the user follows the trajectory almost exactly.
  const auto first_way = [&](double from_m, double to_m) {
    bool back = false;
    double most = 0;
    for (std::size_t i = 0; i < t.rows() && !back; ++i) {
      const double d = t.at("insertion_m", i);
      if (d >= from_m && d < to_m) most = std::max(most, t.at("clamping_n", i));
      back = most > 0 && d > to_m;
    }
    return most;
  };
  const double shallow = first_way(0.001, 0.012), middle = first_way(0.02, 0.025),
               deep = first_way(0.03, 0.035);
  EXPECT_LT(shallow, 0.15);
  EXPECT_GT(middle, 2 * shallow);
  EXPECT_GT(deep, 1.5 * middle);
  // while it turns, the tip is beyond β: tan β = (d/L)²
  for (std::size_t i = 0; i < t.rows(); ++i) {
    const double d = t.at("insertion_m", i), tangent = d * d / (0.06 * 0.06);
    const double beta_m = d * tangent / std::sqrt(1 + tangent * tangent);
    if (t.at("turning", i) > 0 && d > 0.006)
      ASSERT_GE(t.at("clamping_n", i), std::min(1.5, t.at("stiffness_n_per_m", i) * beta_m) - 0.01);
  }
  EXPECT_EQ(t.at("clamping_n", t.rows() - 1), 0);
}

TEST(PaperScene, anUnknownOneIsNamed) {
  const auto scene = paperScene("paper-hip", {}, 1000);
  ASSERT_FALSE(scene.ok());
  EXPECT_EQ(scene.error().code, ErrorCode::kNotFound);
}

}  // namespace

namespace {

using test::sim;
using testing::HasSubstr;

TEST(FiguresCommand, writesEveryTableAndPicture) {
  const test::TempFolder folder;
  const auto out = folder.path() / "new" / "folder";
  const auto outcome = sim({"figures", "--out", out.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::size_t files = 0;
  for (const char* name : {"fig07", "fig08", "fig09", "fig10", "fig11"}) {
    EXPECT_GT(std::filesystem::file_size(out / (std::string(name) + ".csv")), 10'000u);
    EXPECT_THAT(outcome.out, HasSubstr(name));
    files += 1;
    if (!hasGnuplot()) continue;
    EXPECT_GT(std::filesystem::file_size(out / (std::string(name) + ".png")), 20'000u);
    files += 1;
  }
  EXPECT_EQ(static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(out), {})), files);
}

TEST(FiguresCommand, jsonListsTheWrittenFiles) {
  const test::TempFolder folder;
  const auto outcome = sim({"figures", "--out", folder.path().string(), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto whole = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(whole.at("rows").size(), 5u);
  for (const auto& row : whole.at("rows")) {
    EXPECT_TRUE(std::filesystem::exists(row.at("csv").get<std::string>()));
    EXPECT_EQ(row.at("png").is_null(), !hasGnuplot());
  }
}

TEST(FiguresCommand, withoutGnuplotTheTablesAreWrittenWithANotice) {
  const test::TempFolder folder;
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", folder.path().c_str(), 1);
  const auto outcome = sim({"figures", "--out", (folder.path() / "out").string()});
  ::setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("gnuplot"));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "out" / "fig11.csv"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out" / "fig11.png"));
}

TEST(FiguresCommand, aFolderThatCannotBeMadeIsNamed) {
  const test::TempFolder folder;
  const auto file = folder.write("file", "");
  const auto outcome = sim({"figures", "--out", (file / "below").string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr((file / "below").string()));
}

}  // namespace

}  // namespace needlelab

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "client/device/pose_option.h"
#include "client/sim/tools/offline_scene.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/csv.h"
#include "common/haptics/geometry.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab {
namespace {

using test::sim;
using testing::HasSubstr;

// an oblique insertion to 30 mm with a stop, a sideways drift and a withdrawal; tip poses at 1 kHz
std::vector<Pose> gesture() {
  std::vector<Pose> poses;
  const Quat q = normalized(Quat{0.98, 0.05, 0.1, 0.02});
  for (int k = 0; k < 3000; ++k) {
    const double t = k * 1e-3;
    const double depth = t < 1 ? 0.04 * t - 0.01 : t < 2 ? 0.03 : 0.03 - 0.05 * (t - 2);
    const double aside = 0.004 * std::sin(2 * t);
    poses.push_back({{0.1 * depth + aside, -0.05 * depth, -depth}, q});
  }
  return poses;
}

std::string csvOf(const std::vector<Pose>& poses) {
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  for (std::size_t k = 0; k < poses.size(); ++k) {
    appendNumber(text, static_cast<double>(k) * 1e-3);
    text += "," + poseOptionText(poses[k]) + "\n";
  }
  return text;
}

// A table from `run`, as columns of text.
std::map<std::string, std::vector<std::string>> tableOf(const std::filesystem::path& path) {
  std::map<std::string, std::vector<std::string>> table;
  std::istringstream in(*readWholeFile(path));
  std::string line, cell;
  std::vector<std::string> names;
  std::getline(in, line);
  for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    for (const std::string& name : names) {
      std::getline(cells, cell, ',');
      table[name].push_back(cell);
    }
  }
  return table;
}

bool sameBits(double a, double b) {
  return std::memcmp(&a, &b, sizeof a) == 0 || (std::isnan(a) && std::isnan(b));
}

TEST(RunCommand, writesTheEnginesOutputBitForBit) {
  const test::TempFolder folder;
  const auto poses = gesture();
  const auto trajectory = folder.write("t.csv", csvOf(poses)), out = folder.path() / "o.csv";
  const auto profile = test::kSamples / "shoulder-adult.json";
  const auto outcome = sim({"run", "--profile", profile.string(), "--trajectory", trajectory.string(),
                            "--out", out.string(), "--hash"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;

  // the same, using the engine's own functions
  const auto model = compile(*sceneSpecOf(*loadProfile(profile)), 1000);
  ASSERT_TRUE(model.ok());
  auto table = tableOf(out);
  ASSERT_EQ(table["t_s"].size(), poses.size());
  auto state = std::make_unique<SimState>();
  StepReport r;
  std::map<std::string, int> phases;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    step(*model, {poses[k].p, normalized(poses[k].q)}, *state, r);
    const std::pair<const char*, double> row[] = {{"t_s", static_cast<double>(k) * 1e-3},
                                                  {"fx_n", r.wrench_W.force_N.x},
                                                  {"fy_n", r.wrench_W.force_N.y},
                                                  {"fz_n", r.wrench_W.force_N.z},
                                                  {"tx_nm", r.wrench_W.torque_Nm.x},
                                                  {"ty_nm", r.wrench_W.torque_Nm.y},
                                                  {"tz_nm", r.wrench_W.torque_Nm.z},
                                                  {"wx_m", r.p_wall_W_m.x},
                                                  {"wy_m", r.p_wall_W_m.y},
                                                  {"wz_m", r.p_wall_W_m.z},
                                                  {"depth_m", r.depth_m},
                                                  {"insertion_m", r.insertion_m},
                                                  {"alpha_rad", orientationLimitAngle(0.06, r.insertion_m)},
                                                  {"lateral_error_m", r.lateral_error_m},
                                                  {"cutting_n", r.cutting_N},
                                                  {"attracted_n", r.attracted_N},
                                                  {"friction_n", r.friction_N},
                                                  {"puncture_n", r.puncture_N},
                                                  {"clamping_n", r.clamping_N}};
    for (const auto& [name, value] : row)
      ASSERT_TRUE(sameBits(std::strtod(table[name][k].c_str(), nullptr), value)) << name << " in row " << k;
    ASSERT_EQ(table["phase"][k], phaseName(r.phase));
    ASSERT_EQ(table["layer"][k], std::to_string(r.layer));
    ++phases[table["phase"][k]];
  }
  EXPECT_EQ(phases.size(), 4u) << "the gesture does not reach every phase";
  char hash[32];
  std::snprintf(hash, sizeof hash, "%016llx\n", static_cast<unsigned long long>(fnv1a(*readWholeFile(out))));
  EXPECT_EQ(outcome.out, hash);
}

// The gesture with every model that has a section in the profile gives different forces each time.
TEST(RunCommand, runsEveryAxialModel) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", csvOf(gesture()));
  const auto profile = (test::kSamples / "shoulder-models.json").string();
  std::set<std::string> outputs;
  for (const std::string_view model : kAxialModelNames) {
    const auto out = folder.path() / (std::string(model) + ".csv");
    const auto outcome = sim({"run", "--profile", profile, "--trajectory", trajectory.string(), "--out",
                              out.string(), "--model", std::string(model)});
    ASSERT_EQ(outcome.code, 0) << model << "\n" << outcome.err;
    auto table = tableOf(out);
    double deepest_N = 0;
    for (const std::string& cell : table["cutting_n"])
      deepest_N = std::min(deepest_N, std::strtod(cell.c_str(), nullptr));
    EXPECT_LT(deepest_N, -0.5) << model;
    EXPECT_TRUE(outputs.insert(*readWholeFile(out)).second) << model << " gives what another one gave";
  }
}

TEST(RunCommand, aModelWithoutItsSectionIsRefusedWithTheSectionsName) {
  const test::TempFolder folder;
  const auto trajectory = folder.write("t.csv", csvOf(gesture()));
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto run = [&](const std::string& model) {
    return sim({"run", "--profile", profile, "--trajectory", trajectory.string(), "--out",
                (folder.path() / "o.csv").string(), "--replace", "--model", model});
  };
  EXPECT_EQ(run("VOIGT").code, 0) << "it has defaults";
  const auto outcome = run("OKAMURA");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("layers[0].okamura: is missing"));
}

TEST(RunCommand, jsonSummarisesTheRun) {
  const test::TempFolder folder;
  const auto trajectory =
      folder.write("t.csv", "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,0,0,0.01,1,0,0,0\n0.001,0,0,-0.003,1,0,0,0\n");
  const auto out = folder.path() / "o.csv", summary = folder.path() / "o.json";
  ASSERT_EQ(sim({"run", "--profile", (test::kSamples / "paper-1dof.json").string(), "--trajectory",
                 trajectory.string(), "--out", out.string(), "--json", summary.string()})
                .code,
            0);
  const auto whole = nlohmann::json::parse(*readWholeFile(summary));
  ASSERT_EQ(whole.at("rows").size(), 1u);
  const auto& row = whole.at("rows").at(0);
  EXPECT_EQ(row.at("ticks"), 2);
  EXPECT_EQ(row.at("insertions"), 1);
  EXPECT_NEAR(row.at("max_force_n").get<double>(), 1, 1e-12);
  EXPECT_NEAR(row.at("max_depth_m").get<double>(), 0.003, 1e-15);
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx", static_cast<unsigned long long>(fnv1a(*readWholeFile(out))));
  EXPECT_EQ(row.at("hash"), hash);
}

TEST(RunCommand, rowsArePlacedByTheirTimes) {
  const test::TempFolder folder;
  const auto trajectory = folder.write(
      "t.csv",
      "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n7,0,0,0.01,1,0,0,0\n7.001,0,0,0.01,1,0,0,0\n7.003,0,0,0.01,1,0,0,0\n");
  const auto out = folder.path() / "o.csv";
  ASSERT_EQ(sim({"run", "--profile", (test::kSamples / "paper-1dof.json").string(), "--trajectory",
                 trajectory.string(), "--out", out.string()})
                .code,
            0);
  EXPECT_THAT(tableOf(out)["t_s"], testing::ElementsAre("7", "7.001", "7.002", "7.003"));
}

TEST(RunCommand, toolAndPlacementOnlyMoveTheScene) {
  const test::TempFolder folder;
  const auto tips = gesture();
  const Pose X_WL{{0.4, -0.1, 0.2}, normalized(Quat{0.2, -0.3, 0.1, 0.9})};
  const Pose X_HT{{0.01, 0.02, 0.15}, normalized(Quat{0.1, 0.7, 0, 0.7})};
  std::vector<Pose> handles;
  for (const Pose& X_LT : tips) handles.push_back(X_WL * X_LT * inverse(X_HT));
  const auto profile = (test::kSamples / "shoulder-adult.json").string();
  const auto plain = folder.path() / "plain.csv", moved = folder.path() / "moved.csv";
  ASSERT_EQ(sim({"run", "--profile", profile, "--trajectory", folder.write("t.csv", csvOf(tips)).string(),
                 "--out", plain.string()})
                .code,
            0);
  const auto tool = folder.write("tool.json", poseOptionJson(X_HT));
  const auto outcome =
      sim({"run", "--profile", profile, "--trajectory", folder.write("h.csv", csvOf(handles)).string(),
           "--out", moved.string(), "--placement", poseOptionText(X_WL), "--tool", tool.string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  auto a = tableOf(plain), b = tableOf(moved);
  double greatest = 0;
  for (std::size_t k = 0; k < tips.size(); ++k) {
    for (const char* name :
         {"depth_m", "insertion_m", "lateral_error_m", "cutting_n", "attracted_n", "clamping_n"})
      ASSERT_NEAR(std::strtod(a[name][k].c_str(), nullptr), std::strtod(b[name][k].c_str(), nullptr), 1e-9)
          << name << k;
    const auto force = [k](auto& table) {
      const auto number = [&](const char* name) { return std::strtod(table[name][k].c_str(), nullptr); };
      return Vec3{number("fx_n"), number("fy_n"), number("fz_n")};
    };
    ASSERT_LT(norm(rotate(X_WL.q, force(a)) - force(b)), 1e-8);
    greatest = std::max(greatest, norm(force(b)));
  }
  EXPECT_GT(greatest, 1);
}

// every kind of wrong input: exit code 2, a message that names the file and the error, and no output
TEST(RunCommand, refusesWrongInputByNameAndWritesNothing) {
  const test::TempFolder folder;
  const std::string header = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n";
  const std::string good_row = "0,0,0,0.01,1,0,0,0\n";
  const auto good = folder.write("good.csv", header + good_row).string();
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  std::string with_field = *readWholeFile(profile);
  with_field.insert(with_field.find("\"id\""), "\"colour\": 3, ");
  std::string out_of_range = *readWholeFile(profile);
  const std::string force = "\"cutting_force_n\": 1";
  out_of_range.replace(out_of_range.find(force), force.size(), "\"cutting_force_n\": 75");

  struct Case {
    std::string profile, trajectory;
    std::vector<std::string> more;
    std::vector<std::string> named;  // parts of the message
  };
  const auto t = [&](const char* name, const std::string& text) { return folder.write(name, text).string(); };
  const Case cases[] = {
      {profile,
       t("nocolumn.csv", "t_s,px_m,py_m,pz_m,qx,qy,qz\n0,0,0,0,1,0,0\n"),
       {},
       {"nocolumn.csv", "'qw'"}},
      {profile,
       t("nan.csv", header + good_row + "0,0,nan,0.01,1,0,0,0\n"),
       {},
       {"nan.csv line 3", "'py_m'", "'nan'"}},
      {profile, t("empty.csv", ""), {}, {"empty.csv", "empty"}},
      {profile, folder.path().string() + "/missing.csv", {}, {"missing.csv"}},
      {profile, folder.path().string(), {}, {folder.path().string()}},
      {folder.path().string() + "/missing.json", good, {}, {"missing.json"}},
      {t("field.json", with_field), good, {}, {"field.json", "colour"}},
      {t("range.json", out_of_range), good, {}, {"range.json", "layers[0].cutting_force_n", "75", "[0, 50]"}},
      {t("notjson.json", "{"), good, {}, {"notjson.json"}},
      {profile, good, {"--rate", "10"}, {"--rate", "10", "[50, 40000]"}},
      {profile, good, {"--rate", "nan"}, {"--rate", "nan"}},
      {profile, good, {"--rate", "fast"}, {"--rate", "fast"}},
      {profile, good, {"--model", "VOIGTT"}, {"--model", "VOIGTT", "ENHANCED_TRACKING_WALL"}},
      {profile, good, {"--model", "AXIAL_MODEL_UNSPECIFIED"}, {"AXIAL_MODEL_UNSPECIFIED"}},
      {profile, good, {"--placement", "0,0,0,0,0,0,2"}, {"--placement", "2"}},
      {profile, good, {"--tool", "1,2,3"}, {"--tool", "3 numbers"}},
      {profile, good, {"--colour"}, {"--colour"}},
  };
  for (const Case& c : cases) {
    const auto out = folder.path() / "never.csv";
    std::vector<std::string> arguments = {"run",        "--profile", c.profile,   "--trajectory",
                                          c.trajectory, "--out",     out.string()};
    arguments.insert(arguments.end(), c.more.begin(), c.more.end());
    const auto outcome = sim(arguments);
    EXPECT_EQ(outcome.code, 2) << c.named.front() << ": " << outcome.err;
    for (const std::string& part : c.named) EXPECT_THAT(outcome.err, HasSubstr(part));
    EXPECT_FALSE(std::filesystem::exists(out)) << c.named.front();
    EXPECT_EQ(outcome.out, "");
  }
}

TEST(RunCommand, anEarlierOutputStaysWholeWhenARunFails) {
  const test::TempFolder folder;
  const auto out = folder.write("o.csv", "earlier");
  const auto bad = folder.write("bad.csv", "t_s\n0\n");
  const auto outcome = sim({"run", "--profile", (test::kSamples / "paper-1dof.json").string(), "--trajectory",
                            bad.string(), "--out", out.string(), "--replace"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(*readWholeFile(out), "earlier");
  // A missing folder is detected before the work starts.
  const auto good = folder.write("good.csv", "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,0,0,0.01,1,0,0,0\n");
  const auto nowhere = sim({"run", "--profile", (test::kSamples / "paper-1dof.json").string(), "--trajectory",
                            good.string(), "--out", (folder.path() / "no" / "folder.csv").string()});
  EXPECT_EQ(nowhere.code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("folder.csv"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 3);  // no files remain
}

TEST(RunCommand, anOutputThatIsAnInputIsRefused) {
  const test::TempFolder folder;
  const std::string table = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,0,0,0.01,1,0,0,0\n";
  const auto trajectory = folder.write("t.csv", table);
  const auto profile = (test::kSamples / "paper-1dof.json").string();
  const auto link = folder.path() / "other-name.csv";
  std::filesystem::create_symlink(trajectory, link);
  for (const auto& out : {trajectory, link}) {
    const auto outcome =
        sim({"run", "--profile", profile, "--trajectory", trajectory.string(), "--out", out.string()});
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("--out " + out.string()));
  }
  EXPECT_EQ(
      sim({"score", "--profile", profile, "--trajectory", trajectory.string(), "--json", trajectory.string()})
          .code,
      2);
  EXPECT_EQ(*readWholeFile(trajectory), table);
}

// Without the check, each would overwrite its own input with `{"version"…` and exit with 0.
TEST(EveryCommand, refusesAJsonFileThatIsItsInput) {
  const test::TempFolder folder;
  const std::string text = *readWholeFile(test::kSamples / "paper-1dof.json");
  const auto profile = folder.write("p.json", text).string();
  const auto trajectory =
      folder.write("t.csv", "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,0,0,0.01,1,0,0,0\n").string();
  const auto out = (folder.path() / "new").string();
  const std::vector<std::vector<std::string>> lines = {
      {"run", "--profile", profile, "--trajectory", trajectory, "--out", out, "--json", profile},
      {"precompute", "--profile", profile, "--mesh", "500", "--out", out, "--json", profile},
      {"effects", "--no-instructions", "--profile", profile, "--json", profile}};
  for (const auto& line : lines) {
    const auto outcome = sim(line);
    EXPECT_EQ(outcome.code, 2) << line.front();
    EXPECT_THAT(outcome.err, HasSubstr("is the same file as the input")) << line.front();
    EXPECT_EQ(*readWholeFile(profile), text) << line.front();
  }
  // Two outputs must be two different files.
  EXPECT_EQ(sim({"run", "--profile", profile, "--trajectory", trajectory, "--out", out, "--json", out}).code,
            2);
  EXPECT_FALSE(std::filesystem::exists(out));
}

// Without the check, the file written last would replace the other, and the exit code would be 0.
TEST(EveryCommand, refusesAJsonFileThatIsOneOfItsTablesOrPictures) {
  const struct {
    std::vector<std::string> arguments;  // the folder's option comes last
    std::vector<std::string> names;
  } commands[] = {
      {{"figures", "--out"}, {"fig07.csv", "fig09.png", "fig11.csv", "fig11.png"}},
      {{"effects", "--no-instructions", "--out"}, {"effects.csv", "effects_marginal.csv", "effects.png"}},
      {{"stability", "--case", "boundary_hold", "--model", "DIRECT", "--out"},
       {"stability.dat", "stability.png", "stability-holds.csv", "stiffness_limits.json", "device.png"}},
      {{"accuracy", "--study", "verification", "--out"}, {"accuracy.csv"}}};
  for (const auto& command : commands)
    for (const std::string& name : command.names) {
      const test::TempFolder folder;
      auto line = command.arguments;
      const std::string tables = (folder.path() / name).string();
      line.insert(line.end(), {folder.path().string(), "--json", tables});
      const auto outcome = sim(line);
      EXPECT_EQ(outcome.code, 2) << line.front() << " " << name;
      EXPECT_THAT(outcome.err, HasSubstr("--json " + tables)) << line.front();
      EXPECT_EQ(outcome.out, "") << "it worked before it refused: " << line.front();
      EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << line.front() << " " << name;
    }
}

TEST(EveryCommand, refusesAJsonFileInNoFolderBeforeTheWork) {
  const std::vector<std::vector<std::string>> lines = {
      {"figures", "--out"},
      {"effects", "--no-instructions", "--out"},
      {"stability", "--case", "boundary_hold", "--model", "DIRECT", "--out"},
      {"accuracy", "--study", "verification", "--out"}};
  for (auto line : lines) {
    const test::TempFolder folder;
    const std::string tables = (folder.path() / "none" / "rows.json").string();
    line.insert(line.end(), {folder.path().string(), "--json", tables});
    const auto outcome = sim(line);
    EXPECT_EQ(outcome.code, 2) << line.front();
    EXPECT_THAT(outcome.err, HasSubstr("--json " + tables)) << line.front();
    EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << line.front();
  }
}

// a warning, with the numbers
TEST(RunCommand, warnsOfDoubtfulProfileValues) {
  const test::TempFolder folder;
  std::string thin = *readWholeFile(test::kSamples / "paper-1dof.json");
  const std::string thickness = "\"thickness_m\": 0.05";
  ASSERT_NE(thin.find(thickness), std::string::npos);
  thin.replace(thin.find(thickness), thickness.size(), "\"thickness_m\": 0.002");
  const auto trajectory = folder.write("t.csv", "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n0,0,0,0.01,1,0,0,0\n");
  const auto run = [&](const std::string& profile) {
    return sim({"run", "--profile", profile, "--trajectory", trajectory.string(), "--out",
                (folder.path() / "o.csv").string(), "--replace"});
  };
  const auto doubtful = run(folder.write("thin.json", thin).string());
  EXPECT_EQ(doubtful.code, 0);
  EXPECT_THAT(doubtful.err, HasSubstr("layers[0]"));
  EXPECT_THAT(doubtful.err, HasSubstr("fidelity 0.1"));  // 1 − 0.9 N/(500 N/m · 2 mm)
  EXPECT_EQ(run((test::kSamples / "paper-1dof.json").string()).err, "");
}

TEST(SimApp, helpAndVersionAreEverywhere) {
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{}, {"run"}, {"figures"}, {"score"}}) {
    for (const char* flag : {"--help", "--version"}) {
      auto arguments = command;
      arguments.emplace_back(flag);
      const auto outcome = sim(arguments);
      EXPECT_EQ(outcome.code, 0);
      EXPECT_THAT(outcome.out, HasSubstr(flag == std::string("--version") ? programVersion() : "Usage"));
    }
  }
  EXPECT_EQ(sim({}).code, 2);
  EXPECT_EQ(sim({"fly"}).code, 2);
  EXPECT_EQ(sim({"run"}).code, 2);
}

}  // namespace
}  // namespace needlelab

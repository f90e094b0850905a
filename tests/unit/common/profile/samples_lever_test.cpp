// Checks the table of samples and mounted tools in db/samples/README.md.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <array>
#include <filesystem>
#include <set>

#include "common/base/files/files.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

const std::filesystem::path kLeverSamples = NEEDLELAB_SAMPLES;
constexpr std::array<double, 4> kLevers_m = {0.08, 0.1, 0.13, 0.142};

struct Held {
  double handle_Nm_per_rad, share;
};
Held held(const SceneSpec& spec, double lever_m) {
  const auto model = compile(spec, 1000);
  EXPECT_TRUE(model.ok()) << model.error().message;
  if (!model.ok()) return {};
  const Pose X_HT{{0, 0, lever_m}, {}};
  const double axial = model->axialStiffness_N_per_m();
  return {handleStiffness(spec, axial, X_HT).handle_Nm_per_rad,
          heldStiffnessShare(spec, axial, DeviceLimits{}, X_HT)};
}

// one cell: the stiffness at a Desktop's handle, and the share of it that a station renders
std::string cellOf(SceneSpec spec, double lever_m) {
  const std::string_view all = "", less = " without bone";
  std::string_view which = all;
  Held of = held(spec, lever_m);
  if (of.share < kMinStiffnessShare && (spec.effects & bitOf(Effect::kBone)) != 0) {
    spec.effects &= ~bitOf(Effect::kBone);
    of.share = held(spec, lever_m).share;
    which = less;
  }
  if (of.share < kMinStiffnessShare) return fmt::format(" {:.2f}, refused |", of.handle_Nm_per_rad);
  return fmt::format(" {:.2f}, {:.0f} %{} |", of.handle_Nm_per_rad, 100 * of.share, which);
}

std::string rowOf(const std::string& file) {
  const auto profile = loadProfile(kLeverSamples / file);
  if (!profile.ok()) return profile.error().message;
  const auto spec = sceneSpecOf(*profile);
  if (!spec.ok()) return spec.error().message;
  std::string row = "| `" + file + "` |";
  for (const double lever_m : kLevers_m) row += cellOf(*spec, lever_m);
  return row;
}

// the tools of BRINGUP.md: that of `--calibrate --device simulated`, and the stand-in's
TEST(SamplesLever, patientsAreNotRefusedWithTheToolsThatWeShow) {
  for (const Vec3 tip_m : {Vec3{0.012, -0.008, 0.142}, Vec3{0.004, -0.003, 0.135}}) {
    // the needle points along the line from handle to tip
    const double lever_m = norm(tip_m);
    for (const auto& entry : std::filesystem::directory_iterator(kLeverSamples)) {
      const std::string name = entry.path().filename().string();
      if (entry.path().extension() != ".json" || name.find("curriculum") != std::string::npos) continue;
      if (name == "paper-clamping.json") continue;  // the paper's 400 N/m
      const auto profile = loadProfile(entry.path());
      ASSERT_TRUE(profile.ok()) << profile.error().message;
      EXPECT_EQ(cellOf(*sceneSpecOf(*profile), lever_m).find("refused"), std::string::npos) << name;
    }
  }
}

TEST(SamplesLever, theTableIsWhatADesktopHolds) {
  const auto text = readWholeFile(kLeverSamples / "README.md");
  ASSERT_TRUE(text.ok());
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(kLeverSamples)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() == ".json" && name.find("curriculum") == std::string::npos)
      files.insert(name);
  }
  std::string table;
  for (const std::string& file : files) table += rowOf(file) + "\n";
  EXPECT_THAT(*text, testing::HasSubstr(table));
}

}  // namespace
}  // namespace needlelab

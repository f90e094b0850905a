// Checks the table of samples and mounted tools in db/samples/README.md.
#include <fmt/core.h>
#include <gmock/gmock.h>

#include <array>
#include <filesystem>
#include <set>

#include "common/base/files.h"
#include "common/haptics/handle_stiffness.h"
#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

const std::filesystem::path kSamples = NEEDLELAB_SAMPLES;
constexpr std::array<double, 4> kLevers_m = {0.08, 0.1, 0.13, 0.142};

// one line of the table: the stiffness at the handle of a Desktop and the share of it that is rendered
std::string rowOf(const std::string& file) {
  const auto profile = loadProfile(kSamples / file);
  if (!profile.ok()) return profile.error().message;
  const auto spec = sceneSpecOf(*profile);
  if (!spec.ok()) return spec.error().message;
  const auto model = compile(*spec, 1000);
  if (!model.ok()) return model.error().message;
  std::string row = "| `" + file + "` |";
  for (const double lever_m : kLevers_m) {
    const Pose X_HT{{0, 0, lever_m}, {}};
    const double axial = model->axialStiffness_N_per_m();
    const double share = heldStiffnessShare(*spec, axial, DeviceLimits{}, X_HT);
    row += fmt::format(" {:.2f}, {} |", handleStiffness(*spec, axial, X_HT).handle_Nm_per_rad,
                       share < kLeastStiffnessShare ? "refused" : fmt::format("{:.0f} %", 100 * share));
  }
  return row;
}

TEST(SamplesWithTools, theTableIsWhatADesktopHolds) {
  const auto text = readWholeFile(kSamples / "README.md");
  ASSERT_TRUE(text.ok());
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(kSamples)) {
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

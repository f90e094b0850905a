// The epidural sample: its table matches the polynomials (repeated here from the source), and the engine
// renders it.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/curves/curve_fit.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

pb::Profile sample() {
  auto profile =
      loadProfile(std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "db/samples/epidural-porcine.json");
  EXPECT_TRUE(profile.ok()) << profile.error().message;
  return profile.ok() ? std::move(profile).value() : pb::Profile();
}

// Returns the table's value at a depth.
double tableAt(const pb::Precomputed& table, double depth_m) {
  int i = 0;
  while (i + 2 < table.table_size() && table.table(i + 1).depth_m() <= depth_m) ++i;
  const auto &a = table.table(i), &b = table.table(i + 1);
  const double t = (depth_m - a.depth_m()) / (b.depth_m() - a.depth_m());
  return a.cutting_n() + t * (b.cutting_n() - a.cutting_n());
}

// force of the polynomial for the layer at `depth_mm`
double polynomialAt(double depth_mm) {
  struct Piece {
    double thickness_mm, c0, c1, c2, c3;
  };
  constexpr Piece kPieces[] = {{13.92, 0.0235, 0.0116, -0.0046, 0.0025},
                               {3.23, 6.0372, 0.4516, -0.5287, 0},
                               {2.22, 1.9736, 0.8287, 0.1078, 0},
                               {0.63, 4.354, -2.2543, 0.2902, 0},
                               {3.18, 4.4062, 0.9598, 0, 0},
                               {18.0, 7.467, 0, 0, 0},
                               {3.61, 7.467, 1.5029, -0.0583, 0},
                               {3.59, 12.133, -0.1693, -0.1177, 0}};
  for (const Piece& p : kPieces) {
    if (depth_mm < p.thickness_mm)
      return p.c0 + p.c1 * depth_mm + p.c2 * std::pow(depth_mm, 2) + p.c3 * std::pow(depth_mm, 3);
    depth_mm -= p.thickness_mm;
  }
  return 0;
}

TEST(Epidural, theSampleTableMatchesThePolynomialsWithinAHundredthNewton) {
  const pb::Profile profile = sample();
  double worst = 0, end_mm = 0;
  for (const auto& layer : profile.layers()) {
    const double top_mm = end_mm;
    end_mm += layer.thickness_m() * 1e3;
    // inside the layer, except for two micrometres at its ends
    for (double d = top_mm + 0.002; d < end_mm - 0.002; d += 0.003)
      worst = std::max(worst, std::fabs(tableAt(profile.precomputed(), d * 1e-3) - polynomialAt(d)));
  }
  EXPECT_NEAR(end_mm, 56.98, 1e-9);
  EXPECT_LT(worst, 0.011);
  EXPECT_GT(worst, 0.001) << "a table of chords cannot be this good: is the test looking?";
}

TEST(Epidural, theProfileCitesTheSource) {
  const pb::Profile profile = sample();
  EXPECT_NE(profile.sources().find("nitsanti/Epidural-Simulator-Code"), std::string::npos);
  EXPECT_NE(profile.precomputed().source().find("arXiv 2301.11036"), std::string::npos);
}

TEST(Epidural, theEngineRendersTheTableUpToItsSpring) {
  const pb::Profile profile = sample();
  const auto spec = sceneSpecOf(profile);
  ASSERT_TRUE(spec.ok()) << spec.error().message;
  const auto gesture = constantSpeed(-5e-6, 0.056, 0.005, 1000);
  SceneSpec stiff = *spec;
  stiff.tracking_wall.stiffness_N_per_m = 10000;
  const auto soft_run = runStraight(*spec, gesture), stiff_run = runStraight(stiff, gesture);
  ASSERT_TRUE(soft_run.ok() && stiff_run.ok());
  for (std::size_t i = 0; i < gesture.depth_m.size(); ++i) {
    const double depth_mm = gesture.depth_m[i] * 1e3;
    if (depth_mm <= 0.01) continue;
    // A wall never gives more force than the table, and drops together with it.
    EXPECT_LE(soft_run->force_N[i], tableAt(profile.precomputed(), depth_mm * 1e-3) + 1e-9) << depth_mm;
    // at 10,000 N/m it follows within 0.15 mm of the jump at 20 mm
    if (std::fabs(depth_mm - 20.07) > 0.15) {
      EXPECT_NEAR(stiff_run->force_N[i], tableAt(profile.precomputed(), depth_mm * 1e-3), 1e-6) << depth_mm;
    }
  }
  // On the plateau and in the epidural space the sample's own wall reaches it too.
  const auto at = [&](double depth_m) {
    return soft_run->force_N[static_cast<std::size_t>((depth_m - gesture.depth_m[0]) / 5e-6)];
  };
  EXPECT_NEAR(at(0.035), 7.467, 1e-3);
  EXPECT_NEAR(at(0.052), 0, 1e-9);
}

}  // namespace
}  // namespace needlelab

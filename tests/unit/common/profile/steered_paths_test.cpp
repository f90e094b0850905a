// However a needle is steered, it cannot reach a sample's target without going through tissue.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include "common/haptics/engine.h"
#include "common/haptics/surface.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/random.h"
#include "tests/support/run_form.h"
#include "tests/support/scenes/motions.h"

namespace needlelab::test {
namespace {

struct Cost {
  double work_J = 0, peak_N = 0;
};

// the work done by the hand (energy returned by a spring on the way out is not subtracted), and its largest
// force
Cost costOf(const SceneModel& model, const Motion& motion) {
  const auto state = std::make_unique<SimState>();
  StepReport report;
  Cost cost;
  Vec3 force_N{};
  for (std::size_t k = 0; k < motion.size(); ++k) {
    if (k > 0) cost.work_J += std::max(0.0, -dot(force_N, motion[k].p_WT_m - motion[k - 1].p_WT_m));
    step(model, motion[k], *state, report);
    force_N = report.wrench_W.force_N;
    cost.peak_N = std::max(cost.peak_N, norm(force_N));
  }
  return cost;
}

struct Way {
  Vec3 skin_m, target_m, inward, across_1, across_2;
  double depth_m = 0;
};

// straight in above the target
Way wayTo(const SceneModel& model, Vec3 target_m) {
  Way way;
  way.target_m = target_m;
  way.inward = -surfaceNormal(model.limb, target_m, {0, 0, -1});
  way.depth_m = signedDepth(model.limb, target_m);
  way.skin_m = target_m - way.inward * way.depth_m;
  const Vec3 hint = std::abs(way.inward.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
  way.across_1 = normalized(hint - way.inward * dot(hint, way.inward));
  way.across_2 = cross(way.inward, way.across_1);
  return way;
}

Motion straight(const Way& way) {
  MotionBuilder motion(500, way.skin_m - way.inward * 0.004, way.inward);
  return motion.slideTo(way.target_m, 0.02).take();
}

// through random places, with the needle pointing anywhere into the limb
Motion steered(const Way& way, std::uint64_t seed) {
  Random random(seed);
  const auto axis = [&] {
    const double around = random.in(0, 6.283), tangent = std::tan(random.in(0, 1.3));
    return tilted(way.inward, tangent, way.across_1 * std::cos(around) + way.across_2 * std::sin(around));
  };
  // along the needle, across it, or in any direction
  Vec3 points = axis();
  MotionBuilder motion(500, way.skin_m - way.inward * 0.004, points);
  motion.moveTo(way.skin_m - way.inward * 0.0005, points, 0.2);
  const int legs = 1 + static_cast<int>(random.below(4));
  double depth = 0;
  for (int i = 0; i < legs; ++i) {
    depth += random.unit() * (way.depth_m - depth);
    const double most = std::min(0.02, 2 * depth);
    if (random.chance(0.4)) points = axis();
    motion.moveTo(way.skin_m + way.inward * depth + way.across_1 * random.in(-most, most) +
                      way.across_2 * random.in(-most, most),
                  points, random.in(0.2, 1.5));
  }
  return motion.moveTo(way.target_m, points, random.in(0.2, 1.5)).take();
}

TEST(SteeredPaths, noneReachesATargetForLessThanHalfTheStraightCost) {
  const std::uint64_t paths = longForm() ? 2000 : 250;
  int targets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(NEEDLELAB_SAMPLES)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".json" || name.find("curriculum") != std::string::npos) continue;
    const auto profile = loadProfile(entry.path());
    ASSERT_TRUE(profile.ok()) << profile.error().message;
    if (profile->targets_size() == 0 || profile->axial_model() == pb::Profile::FEM) continue;
    const auto spec = sceneSpecOf(*profile);
    ASSERT_TRUE(spec.ok());
    // the fixture contributes to the cost of steering: scenes without it are skipped
    if ((spec->effects & bitOf(Effect::kClamping)) == 0) continue;
    const auto model = compile(*spec, 500);
    ASSERT_TRUE(model.ok()) << model.error().message;
    const auto& center = profile->targets(0).center_m();
    const Way way = wayTo(*model, {center.x(), center.y(), center.z()});
    const Cost whole = costOf(*model, straight(way));
    if (whole.work_J == 0) continue;  // no force along the needle
    ++targets;
    Cost least{1e9, 1e9};
    std::uint64_t least_work = 0, least_peak = 0;
    for (std::uint64_t seed = 0; seed < paths; ++seed) {
      const Cost cost = costOf(*model, steered(way, seed));
      if (cost.work_J < least.work_J) least.work_J = cost.work_J, least_work = seed;
      if (cost.peak_N < least.peak_N) least.peak_N = cost.peak_N, least_peak = seed;
    }
    EXPECT_GE(least.work_J, 0.5 * whole.work_J) << name << ", path " << least_work;
    EXPECT_GE(least.peak_N, 0.5 * whole.peak_N) << name << ", path " << least_peak;
    RecordProperty(name, fmt::format("{:.2f} of {:.2f} mJ, {:.2f} of {:.2f} N", 1e3 * least.work_J,
                                     1e3 * whole.work_J, least.peak_N, whole.peak_N));
  }
  EXPECT_GE(targets, 8);
}

}  // namespace
}  // namespace needlelab::test

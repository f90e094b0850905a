#include "client/sim/accuracy/gesture.h"

#include <algorithm>
#include <utility>

#include "client/device/hand_tremor.h"
#include "client/sim/tools/figures.h"

namespace needlelab {
namespace {

constexpr double kTremor_m = 50e-6;  // normal tremor, peak (DESIGN §10)

double between(HandRandom& random, double low, double high) {
  return low + (high - low) * random.uniform();
}

double tissueThickness_m(const SceneSpec& spec) {
  double sum = 0;
  for (const LayerSpec& layer : spec.layers) sum += layer.thickness_m;
  return sum;
}

constexpr double kOutside_m = 0.008;  // where gestures begin and end, above the surface

// the straight way in along the normal
struct Path {
  Vec3 surface_W_m, outward;
  Quat down;
  double deepest_m;
  explicit Path(const SceneSpec& spec)
      : surface_W_m(std::get<PlaneLimb>(spec.limb).point_m),
        outward(normalized(std::get<PlaneLimb>(spec.limb).normal)),
        down(orientationAlong(outward * -1)),
        deepest_m(0.9 * std::min(tissueThickness_m(spec), spec.needle_length_m)) {}
  [[nodiscard]] Pose at(double depth_m) const { return {surface_W_m - outward * depth_m, down}; }
};

// the plan sampled, with tremor
StudyGesture gestureOf(const SceneSpec& spec, const HandPlan& plan, std::uint64_t seed, double rate_hz) {
  const Vec3 inward = normalized(std::get<PlaneLimb>(spec.limb).normal) * -1;
  HandTremor tremor(kTremor_m, seed, 1 / rate_hz);
  StudyGesture gesture;
  gesture.rate_hz = rate_hz;
  const auto ticks = static_cast<std::size_t>(plan.duration_s() * rate_hz);
  for (std::size_t i = 0; i < ticks; ++i) {
    const double t_s = static_cast<double>(i) / rate_hz;
    const Pose aim = plan.at(t_s).X_WT;
    const double v_mps = dot(inward, aim.p - plan.at(t_s - 1e-3).X_WT.p) / 1e-3;
    const double stop_mps = spec.tracking_wall.stop_speed_mps;
    gesture.intents.push_back(v_mps >= stop_mps    ? Intent::kIn
                              : v_mps <= -stop_mps ? Intent::kOut
                                                   : Intent::kRest);
    gesture.tips.push_back({aim.p + tremor.next(), aim.q});
  }
  return gesture;
}

}  // namespace

Result<std::vector<StudyScene>> studyScenes() {
  std::vector<StudyScene> scenes;
  for (const char* name : {"paper-1dof", "paper-six-layers"}) {
    auto spec = paperSceneSpec(name, {});
    if (!spec.ok()) return spec.error();
    scenes.push_back({name, *std::move(spec)});
  }
  return scenes;
}

HandPlan studyPlan(const SceneSpec& spec, std::uint64_t seed) {
  const Path path(spec);
  HandRandom random(seed);
  const auto speed = [&] { return between(random, 0.008, 0.03); };
  const auto rest = [&] { return between(random, 0.4, 1.6); };
  const double first_m = path.deepest_m * between(random, 0.35, 0.7);
  const double second_m = path.deepest_m * between(random, 0.25, 1.0);
  HandPlan plan(path.at(-kOutside_m));
  plan.hold(0.3).moveTo(path.at(first_m), speed(), Motion::kTrapezoid).hold(rest());
  plan.moveTo(path.at(second_m), speed(), Motion::kMinJerk).hold(rest());
  plan.moveTo(path.at(-kOutside_m), speed(), Motion::kTrapezoid).hold(0.2);
  return plan;
}

StudyGesture studyGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz) {
  return gestureOf(spec, studyPlan(spec, seed), seed, rate_hz);
}

StudyGesture strokeGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz) {
  const Path path(spec);
  HandRandom random(seed);
  double depth_m = path.deepest_m * between(random, 0.3, 0.9);
  HandPlan plan(path.at(-kOutside_m));
  plan.hold(0.1).moveTo(path.at(depth_m), between(random, 0.01, 0.03), Motion::kTrapezoid);
  for (int stroke = 0; stroke < 12; ++stroke) {
    const double way_m = between(random, 0.5e-3, 3e-3);
    plan.moveTo(path.at(depth_m - way_m), between(random, 0.005, 0.02), Motion::kMinJerk);
    plan.moveTo(path.at(depth_m), between(random, 0.005, 0.02), Motion::kMinJerk);
  }
  plan.moveTo(path.at(-kOutside_m), between(random, 0.01, 0.03), Motion::kTrapezoid).hold(0.1);
  return gestureOf(spec, plan, seed, rate_hz);
}

}  // namespace needlelab

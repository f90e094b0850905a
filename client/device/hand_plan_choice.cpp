#include "client/device/hand_plan_choice.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <variant>

#include "client/device/recording_device.h"
#include "client/device/skilled_hand.h"
#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

constexpr double kMiss_rad = 0.3;  // how far `retry` first aims beside the target

Error invalid(const std::string& why) {
  return {ErrorCode::kInvalidInput, "--hand-plan: " + why};
}

// a point of the surface that a hand would take if nobody names a target
Vec3 referencePoint(const Limb& limb) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return plane->point_m;
  if (const auto* sphere = std::get_if<SphereLimb>(&limb))
    return sphere->center_m + outwardNormal(limb, sphere->center_m) * sphere->radius_m;
  const auto& capsule = std::get<CapsuleLimb>(limb);
  const Vec3 middle = (capsule.a_m + capsule.b_m) * 0.5;
  return middle + outwardNormal(limb, middle) * capsule.radius_m;
}

Result<HandPlan> planFromCsv(const std::string& path) {
  auto track = readPoseTrack(path);
  if (!track.ok()) return track.error();
  HandPlan plan(track->X_WH.front());
  if (!track->plunger.empty()) plan.plungerAtStart(track->plunger.front());
  for (std::size_t i = 1; i < track->t_s.size(); ++i) {
    // of rows with the same time the first counts
    const double seconds = track->t_s[i] - track->t_s.front() - plan.duration_s();
    if (seconds > 0)
      plan.moveIn(track->X_WH[i], seconds, track->plunger.empty() ? 0 : track->plunger[i], Motion::kLinear);
  }
  if (plan.duration_s() <= 0) return invalid(path + ": needs at least two rows with different times");
  return plan;
}

Result<HandPlan> planByName(const std::string& kind, const std::string& argument, const HandOptions& options,
                            const SceneSpec& scene, const std::vector<PlanTarget>& targets) {
  PlanStyle style;
  style.insertion_speed_mps = options.speed_mps;
  style.hold_s = options.hold_s;
  style.aspirate = options.aspirate;
  const Vec3 surface = referencePoint(scene.limb);
  const Vec3 n = outwardNormal(scene.limb, surface);
  if (kind == "rest")
    return HandPlan({surface + n * style.approach_m, orientationAlong(-n)}).hold(style.hold_s);

  const bool by_depth = kind == "depth" || (argument.empty() && targets.empty());
  if (by_depth) {
    double depth = 0;
    for (const LayerSpec& layer : scene.layers) depth += layer.thickness_m;
    depth = std::min(depth / 2, 0.8 * scene.needle_length_m);
    if (!argument.empty()) {
      const auto [end, error] = std::from_chars(argument.data(), argument.data() + argument.size(), depth);
      if (error != std::errc() || end != argument.data() + argument.size() || !(depth > 0 && depth <= 1))
        return invalid("depth '" + argument + "' is not a number of metres above 0 and up to 1");
    }
    return insertionPlan(surface, -n, depth, style);
  }

  const auto named = std::find_if(targets.begin(), targets.end(), [&](const PlanTarget& target) {
    return argument.empty() || target.name == argument;
  });
  if (named == targets.end()) {
    std::string known;
    for (const PlanTarget& target : targets) known += (known.empty() ? "'" : ", '") + target.name + "'";
    return invalid("the profile has no target '" + argument + "'" +
                   (known.empty() ? "; it has no targets" : "; it has " + known));
  }
  if (!(signedDepth(scene.limb, named->center_W_m) > 0))
    return invalid("target '" + named->name + "' is not inside the limb");
  if (kind == "retry") return retryPlan(scene.limb, named->center_W_m, kMiss_rad, style);
  if (options.skill) {
    HandRandom random(options.seed);
    return attemptPlan(skillOf(*options.skill), scene.limb, named->center_W_m, random, named->entry_W_m);
  }
  return targetPlan(scene.limb, named->center_W_m, style);
}

}  // namespace

Result<HandPlan> choosePlan(const HandOptions& options, const SceneSpec& scene_W,
                            const std::vector<PlanTarget>& targets_W) {
  if (!(options.speed_mps > 0 && options.speed_mps <= 0.5))
    return Error{ErrorCode::kInvalidInput, "--hand-speed-m-s: " + std::to_string(options.speed_mps) +
                                               ", allowed is above 0 and up to 0.5"};
  if (!(options.hold_s > 0 && options.hold_s <= 600))
    return Error{ErrorCode::kInvalidInput,
                 "--hand-hold-s: " + std::to_string(options.hold_s) + ", allowed is above 0 and up to 600"};
  if (options.plan == kPointerPlan)
    return invalid(
        "pointer: mouse and keys need a window to steer in; choose another plan, or open the window");
  const std::size_t colon = options.plan.find(':');
  const std::string kind = options.plan.substr(0, colon);
  const std::string argument = colon == std::string::npos ? "" : options.plan.substr(colon + 1);
  const bool is_name = kind == "target" || kind == "retry" || kind == "depth" || kind == "rest";
  auto plan = is_name ? planByName(kind, argument, options, scene_W, targets_W) : planFromCsv(options.plan);

  // a plan that is done again must end where it starts, or the hand would jump, and so would the plunger
  if (plan.ok() && options.repeat != 1) {
    if (plan->end().plunger != plan->start().plunger) plan->hold(0.5, plan->start().plunger);
    if (plan->end().X_WT != plan->start().X_WT)
      plan->moveTo(plan->start().X_WT, 5 * options.speed_mps, Motion::kMinJerk);
  }
  return plan;
}

HandPlan steeredStart(const SceneSpec& scene_W, const std::vector<PlanTarget>& targets_W) {
  constexpr double kOutside_m = 0.03, kBeside_m = 0.015;
  const Vec3 entry = !targets_W.empty() && targets_W.front().entry_W_m ? *targets_W.front().entry_W_m
                                                                       : referencePoint(scene_W.limb);
  const Vec3 n = outwardNormal(scene_W.limb, entry);
  const Vec3 right = std::abs(n.y) < 0.9 ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
  const Vec3 beside = normalized(right - n * dot(right, n));
  HandPlan plan({entry + n * kOutside_m + beside * kBeside_m, orientationAlong(-n)});
  plan.plungerAtStart(kPlungerBeforeAspiration);
  return plan;
}

}  // namespace needlelab

#include "client/device/hand/hand_options.h"

#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <variant>

#include "client/device/recording/needle_direction.h"
#include "client/device/recording/recording_device.h"
#include "common/base/plausible.h"
#include "common/base/text/csv_rows.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

// unlike CLI::Range, rejects `nan`
CLI::Validator within(double low, double high, bool low_allowed = true) {
  const std::string allowed = fmt::format("{}{:g} to {:g}", low_allowed ? "" : "above ", low, high);
  return CLI::Validator(
      [low, high, low_allowed, allowed](std::string& text) -> std::string {
        double value = 0;
        const bool number = CLI::detail::lexical_cast(text, value);
        if (number && value <= high && (low_allowed ? value >= low : value > low)) return {};
        return "value " + text + ", allowed is " + allowed;
      },
      allowed);
}

// CLI11 2.1 turns -1 into 2^64 − 1
const CLI::Validator kDigits(
    [](std::string& text) -> std::string {
      const bool ok = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
      return ok ? "" : "value " + text + ", allowed is a whole number from 0 on";
    },
    "from 0 on");

constexpr HandSkill kBeginner{250e-6, 0.010, 4e-3, 5e-3, 6, 0};
constexpr HandSkill kExpert{40e-6, 0.020, 0.7e-3, 0.5e-3, 1, kBracing_N_per_m};
constexpr double kApproach_m = 0.02, kRest_s = 0.5;
constexpr double kOnSurface_m = 1e-6;

/// Approximately normal: the sum of twelve uniform numbers minus six; the bits do not depend on the C
/// library.
double nearlyNormal(HandRandom& random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += random.uniform();
  return sum;
}

/// Normalises an author's plane: `signedDepth` requires a unit normal.
double depthBelow(Limb limb, Vec3 p_W_m) {
  if (auto* plane = std::get_if<PlaneLimb>(&limb)) plane->normal = normalized(plane->normal);
  return signedDepth(limb, p_W_m);
}

constexpr double kFeelingSpeed_mps = 0.05;  // of a hand that feels for a landmark
constexpr double kCapPress_s = 0.1;
constexpr double kMiss_rad = 0.3;  // how far `retry` first aims beside the target

Error invalid(const std::string& why) {
  return {ErrorCode::kInvalidInput, "--hand-plan: " + why};
}

// the surface point for a hand without a target; in a body the one nearest to its own origin, which authors
// put where the needle goes in
Vec3 referencePoint(const Limb& limb) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return plane->point_m;
  if (const auto* sphere = std::get_if<SphereLimb>(&limb))
    return sphere->center_m + outwardNormal(limb, sphere->center_m) * sphere->radius_m;
  if (const auto* body = std::get_if<BodyLimb>(&limb)) return nearestSkin(limb, body->X_WL.p, {0, 0, -1});
  const auto& capsule = std::get<CapsuleLimb>(limb);
  const Vec3 middle = (capsule.a_m + capsule.b_m) * 0.5;
  return middle + outwardNormal(limb, middle) * capsule.radius_m;
}

Result<HandPlan> planFromCsv(const std::string& path, const Limb& limb) {
  ASSIGN_OR_RETURN(auto track, readPoseTrack(path));
  warnOfDirection(path, limb, track, {});
  HandPlan plan(track.X_WH.front());
  if (!track.plunger.empty()) plan.plungerAtStart(track.plunger.front());
  for (std::size_t i = 1; i < track.t_s.size(); ++i) {
    const double seconds = track.t_s[i] - track.t_s.front() - plan.duration_s();
    if (seconds > 0)
      plan.moveIn(track.X_WH[i], seconds, track.plunger.empty() ? 0 : track.plunger[i], Motion::kLinear);
  }
  if (plan.duration_s() <= 0) return invalid(path + ": needs at least two rows");
  return plan;
}

// the first target without a name; null: there is none
const PlanTarget* targetNamed(const std::vector<PlanTarget>& targets, const std::string& name) {
  const auto named = std::find_if(targets.begin(), targets.end(), [&](const PlanTarget& target) {
    return name.empty() || target.name == name;
  });
  return named == targets.end() ? nullptr : &*named;
}

// of a plan without a target
double usualDepth_m(const SceneSpec& scene) {
  double depth_m = 0;
  for (const LayerSpec& layer : scene.layers) depth_m += layer.thickness_m;
  // a body's structures have no thickness
  if (std::holds_alternative<BodyLimb>(scene.limb)) depth_m = scene.needle_length_m;
  return std::min(depth_m / 2, 0.8 * scene.needle_length_m);
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
    double depth = usualDepth_m(scene);
    if (!argument.empty()) {
      const auto number = numberOf(argument);
      if (!number || !(*number > 0))
        return invalid("depth '" + argument + "' is not a number of metres above 0");
      depth = *number;
      RETURN_IF_ERROR(checkPlausible("--hand-plan: depth", Quantity::kDepth, depth));
    }
    return insertionPlan(surface, -n, depth, style);
  }

  const PlanTarget* const named = targetNamed(targets, argument);
  if (named == nullptr) {
    std::string known;
    for (const PlanTarget& target : targets) known += (known.empty() ? "'" : ", '") + target.name + "'";
    return invalid("the profile has no target '" + argument + "'" +
                   (known.empty() ? "; it has no targets" : "; it has " + known));
  }
  if (!(signedDepth(scene.limb, named->center_W_m) > 0))
    return invalid("target '" + named->name + "' is not inside the limb");
  if (kind == "retry") return retryPlan(scene.limb, named->center_W_m, kMiss_rad, style, named->entry_W_m);
  if (options.skill) {
    HandRandom random(options.seed);
    return attemptPlan(skillOf(*options.skill), scene.limb, named->center_W_m, random, named->entry_W_m);
  }
  return targetPlan(scene.limb, named->center_W_m, style, named->entry_W_m);
}

}  // namespace

// --- options ---

void addHandOptions(CLI::App& app, HandOptions& o) {
  const auto add = [&](const char* name, auto& value, const char* text) {
    return app.add_option(name, value, text)->capture_default_str()->group("Simulated hand");
  };
  o.correction_per_s = kCommandLineCorrection_per_s;
  o.bracing_N_per_m = kBracing_N_per_m;
  o.aspirate = true;
  add("--hand-plan", o.plan,
      "target[:NAME], retry[:NAME], depth[:METRES], rest, a CSV file of tip poses, or, in a window, pointer: "
      "mouse and keys move it");
  auto* skill =
      app.add_option_function<double>(
             "--hand-skill",
             [&o](double level) {
               const HandSkill hand = skillOf(level);
               o.skill = level;
               o.tremor_m = hand.tremor_m;
               o.speed_mps = hand.speed_mps;
               o.bracing_N_per_m = hand.bracing_N_per_m;
             },
             "from 0, a beginner, to 1, an expert: tremor, speed, bracing, aim, overshoot and smoothness of "
             "an attempt at the target")
          ->group("Simulated hand")
          ->check(within(0, 1));
  add("--hand-speed-m-s", o.speed_mps, "speed of insertion and withdrawal")
      ->check(within(0, 0.5, false))
      ->excludes(skill);
  add("--hand-hold-s", o.hold_s, "time at the target")->check(within(0, 600, false));
  app.add_flag("--hand-aspirate,!--hand-no-aspirate", o.aspirate,
               "draws the plunger back at the target before it injects; that is the default")
      ->group("Simulated hand");
  add("--hand-repeat", o.repeat, "how often the plan is done; 0 = until stopped")->check(kDigits);
  add("--hand-correction", o.correction_per_s,
      "share of the error that the aim makes up for in a second; 0 = none")
      ->check(within(0, 20));
  add("--hand-tremor-m", o.tremor_m, "tremor in 8-12 Hz, peak per axis")
      ->check(within(0, 0.005))
      ->excludes(skill);
  add("--hand-seed", o.seed, "seed of the tremor")->check(kDigits);
  add("--hand-stiffness", o.stiffness_N_per_m, "in N/m")->check(within(0, 10'000));
  add("--hand-damping", o.damping_Ns_per_m, "in N·s/m")->check(within(0, 100));
  add("--hand-bracing", o.bracing_N_per_m,
      "more stiffness along the needle: the hand rests on the patient, in N/m")
      ->check(within(0, 10'000))
      ->excludes(skill);
  add("--hand-rotational-stiffness", o.rotational_stiffness_Nm_per_rad, "in N·m/rad")->check(within(0, 100));
  add("--hand-rotational-damping", o.rotational_damping_Nms_per_rad, "in N·m·s/rad")->check(within(0, 5));
}

// --- skill ---

HandSkill skillOf(double level) {
  const double share = std::clamp(level, 0.0, 1.0);
  const auto between = [share](double beginner, double expert) {
    return beginner * std::pow(expert / beginner, share);
  };
  return {between(kBeginner.tremor_m, kExpert.tremor_m), between(kBeginner.speed_mps, kExpert.speed_mps),
          between(kBeginner.aim_m, kExpert.aim_m),       between(kBeginner.overshoot_m, kExpert.overshoot_m),
          between(kBeginner.pieces, kExpert.pieces),     share * kExpert.bracing_N_per_m};
}

HandOptions handOf(const HandSkill& skill, std::uint64_t seed) {
  HandOptions hand;
  hand.tremor_m = skill.tremor_m;
  hand.speed_mps = skill.speed_mps;
  hand.correction_per_s = kCommandLineCorrection_per_s;
  hand.bracing_N_per_m = skill.bracing_N_per_m;
  hand.aspirate = true;
  hand.seed = seed;
  return hand;
}

std::optional<Vec3> markedEntry(const Limb& limb_W, const Pose& X_WL) {
  if (!(std::abs(depthBelow(limb_W, X_WL.p)) <= kOnSurface_m)) return std::nullopt;
  return X_WL.p;
}

HandPlan attemptPlan(const HandSkill& skill, const Limb& limb_W, Vec3 target_W_m, HandRandom& random,
                     std::optional<Vec3> entry_W_m) {
  const Vec3 n = outwardNormal(limb_W, target_W_m);
  const Vec3 meant = entry_W_m ? *entry_W_m : skinAbove(limb_W, target_W_m, n);
  const Vec3 back = normalized(meant - target_W_m);
  const Vec3 side = normalized(cross(back, std::abs(back.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const Vec3 other = cross(back, side);
  const auto astray = [&] {
    // the order of two calls in one expression is the compiler's
    const double along_other = nearlyNormal(random), along_side = nearlyNormal(random);
    return (skill.aim_m * along_side) * side + (skill.aim_m * along_other) * other;
  };
  // the hand's way: from its entry to its estimate of the target
  const Vec3 entry = meant + astray();
  const Vec3 believed = target_W_m + 0.5 * astray();
  const Vec3 way = believed - entry;
  const double length_m = norm(way);
  const Vec3 axis = way / length_m;
  const Quat q = orientationAlong(axis);
  const auto at = [&](double along_m) { return Pose{entry + axis * along_m, q}; };
  const double beyond_m = skill.overshoot_m * (0.5 + random.uniform());

  // speed varies by a tenth between attempts
  const double speed_mps = skill.speed_mps * (0.9 + 0.2 * random.uniform());
  HandPlan plan(at(-kApproach_m));
  plan.plungerAtStart(kPlungerBeforeAspiration).hold(kRest_s);
  const int pieces = std::max(1, static_cast<int>(std::lround(skill.pieces + 0.5 * nearlyNormal(random))));
  const double whole_m = kApproach_m + length_m + beyond_m;
  for (int piece = 1; piece <= pieces; ++piece) {
    // pieces of uneven length, with a hesitation after each but the last
    const double share = piece == pieces ? 1 : (piece + 0.3 * (random.uniform() - 0.5)) / pieces;
    plan.moveTo(at(-kApproach_m + share * whole_m), speed_mps, Motion::kMinJerk);
    if (piece < pieces) plan.hold(0.15 + 0.35 * random.uniform());
  }
  plan.hold(0.2).moveTo(at(length_m), speed_mps, Motion::kMinJerk);
  plan.hold(0.8).hold(0.6, 0).hold(0.4).hold(1.2, 1).hold(0.3);
  plan.moveTo(at(-kApproach_m), speed_mps, Motion::kMinJerk).hold(kRest_s);
  return plan;
}

// --- plans ---

Result<HandPlan> choosePlan(const HandOptions& options, const SceneSpec& scene_W,
                            const std::vector<PlanTarget>& targets_W) {
  if (!(options.speed_mps > 0 && options.speed_mps <= 0.5))
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("--hand-speed-m-s: {:f}, allowed is above 0 and up to 0.5", options.speed_mps)};
  if (!(options.hold_s > 0 && options.hold_s <= 600))
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("--hand-hold-s: {:f}, allowed is above 0 and up to 600", options.hold_s)};
  if (options.plan == kPointerPlan)
    return invalid(
        "pointer: mouse and keys need a window to steer in; choose another plan, or open the window");
  const std::size_t colon = options.plan.find(':');
  const std::string kind = options.plan.substr(0, colon);
  const std::string argument = colon == std::string::npos ? "" : options.plan.substr(colon + 1);
  const bool is_name = kind == "target" || kind == "retry" || kind == "depth" || kind == "rest";
  auto plan = is_name ? planByName(kind, argument, options, scene_W, targets_W)
                      : planFromCsv(options.plan, scene_W.limb);
  if (!plan.ok()) return plan;
  const bool caps = options.capped && kind != "rest";
  if (caps) {
    const PlanTarget* const target =
        kind == "target" || kind == "retry" ? targetNamed(targets_W, argument) : nullptr;
    plan = withCapTakenOff(*plan, scene_W, target != nullptr ? target->landmark_W_m : std::nullopt);
  }

  // a repeated plan must end where it starts, or hand, plunger and cap would jump
  if (options.repeat != 1) {
    if (plan->end().plunger != plan->start().plunger) plan->hold(0.5, plan->start().plunger);
    if (plan->end().X_WT != plan->start().X_WT)
      plan->moveTo(plan->start().X_WT, 5 * options.speed_mps, Motion::kMinJerk);
    if (caps) plan->pressCapButton(kCapPress_s);
  }
  return plan;
}

PlannedInsertion plannedInsertion(const SceneSpec& scene_W, const std::vector<PlanTarget>& targets_W,
                                  const std::optional<PlannedLine>& line_W) {
  const Limb& limb = scene_W.limb;
  const PlanTarget* const target = targets_W.empty() ? nullptr : &targets_W.front();
  const Vec3 reference = target != nullptr ? target->center_W_m : referencePoint(limb);
  const Vec3 n = outwardNormal(limb, reference);
  PlannedInsertion way{reference, -n, usualDepth_m(scene_W)};
  if (line_W) {
    way.entry_W_m = line_W->entry_m;
    way.direction_W = line_W->direction;
  } else if (target != nullptr) {
    way.entry_W_m = target->entry_W_m.value_or(skinAbove(limb, target->center_W_m, n));
    const Vec3 in = target->center_W_m - way.entry_W_m;
    if (normSquared(in) > 0) way.direction_W = normalized(in);
  }
  if (target == nullptr) return way;
  way.depth_m = std::max(0.0, dot(target->center_W_m - way.entry_W_m, way.direction_W));
  way.landmark_W_m = target->landmark_W_m;
  return way;
}

HandPlan withCapTakenOff(const HandPlan& plan, const SceneSpec& scene_W,
                         const std::optional<Vec3>& landmark_W_m) {
  HandPlan before = landmark_W_m ? palpationPlan(scene_W, *landmark_W_m, kFeelingSpeed_mps)
                                 : HandPlan(plan.start().X_WT).pressCapButton(kCapPress_s);
  return before.setPlunger(plan.start().plunger).then(plan, kFeelingSpeed_mps);
}

HandPlan steeredStart(const PlannedInsertion& way) {
  HandPlan plan({way.entry_W_m - way.direction_W * kSteeredStart_m, orientationAlong(way.direction_W)});
  plan.plungerAtStart(kPlungerBeforeAspiration);
  return plan;
}

}  // namespace needlelab

#include "client/station/run/lesson/lesson.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/device/hand/hand_options.h"
#include "client/station/run/lesson/ladder.h"
#include "client/view/model/plot.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/surface.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/structure_region.h"
#include "common/scoring/targets/reachable.h"

namespace needlelab {
namespace {

Result<StationLesson> lessonOf(pb::Profile profile, const StationOptions& options) {
  StationLesson lesson;
  if (!options.model.empty()) RETURN_IF_ERROR(chooseModel(profile, options.model));
  ASSIGN_OR_RETURN(auto scene, sceneSpecOf(profile, options.X_WL));
  if (Status status = addCompliance(scene); !status.ok())
    return Error{status.error().code, "profile " + profile.id() + ": " + status.error().message};
  auto model = compile(scene, options.rate_hz);
  if (!model.ok()) return Error{model.error().code, "profile " + profile.id() + ": " + model.error().message};
  lesson.warnings = profileWarnings(profile);
  for (std::string& target : unreachableTargets(profile, profile.needle().length_m()))
    lesson.warnings.push_back(std::move(target));
  lesson.profile = std::move(profile);
  lesson.scene = std::move(scene);
  lesson.model = *model;
  return lesson;
}

bool lacksTorque(const DeviceInfo& device) {
  return device.renders_force && !device.renders_torque;
}

// where there is least between the landmark and the skin, about a place: each in turn is nearest to the other
Vec3 leastCovered(const StructureRegion& landmark, const Limb& limb_W, Vec3 place_W_m) {
  constexpr int kTurns = 20;
  for (int i = 0; i < kTurns; ++i) place_W_m = landmark.nearest(closestSkin(limb_W, place_W_m, {0, 0, -1}));
  return place_W_m;
}

}  // namespace

Result<StationLesson> lessonOfFile(const StationOptions& options) {
  ASSIGN_OR_RETURN(auto profile, loadProfile(options.profile_file));
  return lessonOf(std::move(profile), options);
}

Result<StationLesson> lessonOfMessage(const StationOptions& options, const pb::Lesson& message) {
  ASSIGN_OR_RETURN(auto exercise, parseExercise(message.exercise_json(), "exercise " + options.exercise));
  ASSIGN_OR_RETURN(auto profile,
                   parseProfile(message.profile_json(), "profile of exercise " + options.exercise));
  ASSIGN_OR_RETURN(auto lesson, lessonOf(std::move(profile), options));
  lesson.exercise = std::move(exercise);
  lesson.profile_revision = message.profile_revision();
  lesson.attempt = message.attempt();
  if (message.has_attempts_left()) lesson.attempts_left = message.attempts_left();
  lesson.exam = message.exam();
  lesson.results_from_unix_ns = message.results_from_unix_ns();
  return lesson;
}

LiveAids aidsOf(const AidList& aids) {
  return {hasAid(aids, pb::Exercise::PHASE), hasAid(aids, pb::Exercise::LAYER),
          hasAid(aids, pb::Exercise::DEPTH), hasAid(aids, pb::Exercise::FORCE)};
}

AidList allowedAids(const StationLesson& lesson) {
  return lesson.exercise ? aidsOfExercise(*lesson.exercise) : usualAids();
}

LiveAids aidsOf(const StationLesson& lesson) {
  return aidsOf(allowedAids(lesson));
}

std::vector<PlanTarget> targetsOf(const pb::Profile& profile, const Pose& X_WL) {
  std::vector<PlanTarget> targets;
  const auto scene = sceneSpecOf(profile, X_WL);
  const auto entry = scene.ok() ? markedEntry(scene->limb, X_WL) : std::nullopt;
  const double behind_m = openingBehindTip_m(needleOf(profile.needle()));
  const Anatomy anatomy = anatomyOf(profile, X_WL);
  for (const Target& target : anatomy.targets) {
    const Vec3 tip_W_m = tipForTarget(anatomy, target, behind_m, entry);
    targets.push_back({target.ball.name, tip_W_m, entry, std::nullopt});
    if (anatomy.landmark)
      targets.back().landmark_W_m =
          leastCovered(*anatomy.landmark, scene->limb, anatomy.landmark->nearest(entry.value_or(tip_W_m)));
  }
  return targets;
}

std::string examTerms(const StationLesson& lesson, double time_limit_s) {
  std::string terms = lesson.attempts_left ? attemptsLeftText(*lesson.attempts_left) + ", " : "";
  if (time_limit_s > 0)
    terms += (std::fmod(time_limit_s, 60) == 0 ? fmt::format("{:.0f}", time_limit_s / 60)
                                               : clockText(time_limit_s)) +
             " min, ";
  return terms + "counts";
}

std::vector<std::string> liveEffects(const SceneModel& model) {
  return effectNames(model.live);
}

Status checkStiffness(const SceneModel& model, const DeviceInfo& device) {
  if (!device.renders_force) return {};
  const double axial = model.axialStiffness_N_per_m(), most = device.limits.max_stiffness_N_per_m;
  if (axial <= most) return {};
  return Error{
      ErrorCode::kInvalidInput,
      fmt::format(
          "the scene is too stiff for the {}: what acts at once along the needle (wall and friction or a "
          "membrane, with the fixture; or the hub, bone or cap) is {:.4g} N/m, the device renders at most {:.4g} "
          "N/m; use a softer profile",
          device.name, axial, most)};
}

SceneSpec forDevice(SceneSpec scene, const DeviceInfo& device, std::vector<std::string>& notes) {
  if (!device.has_orientation)
    notes.push_back(
        "The device does not measure how it is turned: the needle enters along the inward normal at the "
        "point of entry, and from 2 mm on its axis is the line from there to the tip. Angles of the needle "
        "in the recording and in its measures are those of that axis.");
  for (const EffectEntry* entry : effectEntries()) {
    const bool turns = entry->on_device.turning_Nm_per_rad != nullptr;
    if (!turns || (scene.effects & bitOf(entry->effect)) == 0) continue;
    if (device.has_orientation && !lacksTorque(device)) continue;
    scene.effects &= ~bitOf(entry->effect);
    notes.push_back(
        fmt::format("{} is not live: {}.", entry->name,
                    lacksTorque(device) ? "the device renders no torque" : "it needs the needle's angle"));
  }
  return scene;
}

namespace {

std::string acrossText(const HandleStiffness& wanted, const DeviceInfo& device, const Pose& lever) {
  return fmt::format(
      "Across the needle the scene is {:.4g} N/m at the tip and, with the tool's lever of {:.0f} mm, {:.3g} "
      "N·m/rad at the handle; the {} holds {:.4g} N/m and {:.3g} N·m/rad",
      wanted.across_N_per_m, 1e3 * norm(lever.p), wanted.handle_Nm_per_rad, device.name,
      device.limits.max_stiffness_N_per_m, device.limits.max_rotational_stiffness_Nm_per_rad);
}

// lowers `lesson.model` to what is stable behind a delay, and leaves its share
Status lowerForDelay(StationLesson& lesson, const DeviceInfo& device, const LoopDelay& delay,
                     std::vector<std::string>& notes) {
  const SceneModel& model = lesson.model;
  const double ticks = delay.totalTicks(model.rate_hz);
  const double most = stableInLightestGrip_N_per_m(device.limits.damping_Ns_per_m, model.rate_hz, ticks);
  const double axial = model.axialStiffness_N_per_m();
  if (axial <= most * (1 + 1e-9)) return {};
  const double share = most / axial;
  const std::string what = fmt::format(
      "The scene is {:.4g} N/m along the needle; with forces {:.2g} ticks late{} at {:.4g} Hz, the {} and the "
      "lightest grip hold {:.4g} N/m",
      axial, ticks, delay.is_known ? "" : " (assumed; --measure-delay finds it)", model.rate_hz, device.name,
      most);
  const bool has_wall = axialEntry(model.axial_model).has_tracking_wall;
  if (!has_wall || share < kMinStiffnessShare)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("{}: {}; make the delay shorter (a real-time kernel, a direct connection, a faster "
                    "loop) or use a softer profile",
                    what,
                    has_wall ? fmt::format("{:.0f} % of it, and a lesson needs {:.0f} %", 100 * share,
                                           100 * kMinStiffnessShare)
                             : fmt::format("{} has no wall whose stiffness could be lowered",
                                           axialModelName(model.axial_model)))};
  lesson.shares.delay = share;
  notes.push_back(fmt::format("{}. It is rendered at {:.0f} %.", what, 100 * share));
  return {};
}

// the model with the walls as the delay lowers them
Result<SceneModel> behindDelay(const StationLesson& lesson) {
  SceneSpec scene = lesson.scene;
  lowerStiffness(scene, {.delay = lesson.shares.delay});
  return compile(scene, lesson.model.rate_hz);
}

}  // namespace

Status lowerForDevice(StationLesson& lesson, const DeviceInfo& device, const LoopDelay& delay,
                      const Pose& X_HT, std::vector<std::string>& notes) {
  if (!device.renders_force) return {};
  RETURN_IF_ERROR(lowerForDelay(lesson, device, delay, notes));
  // without torque there is no lever: the fixture acts on the handle as at the tip
  const bool has_lever = device.renders_torque && device.has_orientation;
  const Pose lever = has_lever ? X_HT : Pose{};
  if (lesson.shares.delay < 1) {
    ASSIGN_OR_RETURN(lesson.model, behindDelay(lesson));
  }
  double axial = lesson.model.axialStiffness_N_per_m();
  const auto shareOf = [&](const SceneSpec& scene) {
    return heldStiffnessShare(scene, axial, device.limits, lever);
  };
  double share = shareOf(lesson.scene);
  // bone this soft would not feel like bone: such an effect is omitted, as if the device could not render it
  for (const EffectEntry* entry : effectEntries()) {
    if (share >= kMinStiffnessShare) break;
    const std::string_view without = entry->on_device.without;
    if (without.empty() || (lesson.scene.effects & bitOf(entry->effect)) == 0) continue;
    notes.push_back(fmt::format("{}. {} is not live: {}.",
                                acrossText(handleStiffness(lesson.scene, axial, lever), device, lever),
                                entry->name, without));
    lesson.scene.effects &= ~bitOf(entry->effect);
    lesson.left_out |= bitOf(entry->effect);
    ASSIGN_OR_RETURN(const auto model, behindDelay(lesson));
    axial = model.axialStiffness_N_per_m();
    share = shareOf(lesson.scene);
  }
  const HandleStiffness wanted = handleStiffness(lesson.scene, axial, lever);
  const std::string what = acrossText(wanted, device, lever);
  if (share < kMinStiffnessShare)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("{}: {:.0f} % of it, and a lesson needs {:.0f} %; use a shorter tool or a softer "
                    "virtual_fixture and orientation_limit",
                    what, 100 * share, 100 * kMinStiffnessShare)};
  lesson.shares.lever = share;
  lowerStiffness(lesson.scene, lesson.shares);
  if (share < 1)
    notes.push_back(fmt::format("{}. It is rendered at {:.0f} %: at most {:.4g} N/m across the needle.", what,
                                100 * share, share * wanted.across_N_per_m));
  return {};
}

std::optional<std::string> unprovenPassivity(const StationLesson& lesson, const DeviceInfo& device,
                                             const LoopDelay& delay, const Pose& X_HT) {
  if (!device.renders_force) return std::nullopt;
  const SceneModel& model = lesson.model;
  const bool has_lever = device.renders_torque && device.has_orientation;
  const double axial = model.axialStiffness_N_per_m();
  const HandleStiffness handle = handleStiffness(lesson.scene, axial, has_lever ? X_HT : Pose{});
  const double half_more = 0.5 + delay.totalTicks(model.rate_hz);
  const double own = model.isLive(Effect::kCutting) ? model.axial_damping_Ns_per_m : 0.0;
  const double most = std::max(0.0, device.limits.damping_Ns_per_m - own) / (model.period_s * half_more);
  const double max_turn = device.limits.max_rotational_stiffness_Nm_per_rad * std::min(1.0, 1.5 / half_more);
  const double steepest = std::max(axial, handle.across_N_per_m);
  const bool turns = device.renders_torque && handle.handle_Nm_per_rad > max_turn * (1 + 1e-9);
  if (steepest <= most * (1 + 1e-9) && !turns) return std::nullopt;
  return fmt::format(
      "{} and the device, which damps {:.3g} N·s/m and renders a force {:.2g} ticks late, is passive up to {}",
      !turns ? fmt::format("the scene is {:.4g} N/m steep", steepest)
             : fmt::format("the scene is {:.3g} N·m/rad steep about the handle", handle.handle_Nm_per_rad),
      device.limits.damping_Ns_per_m, delay.totalTicks(model.rate_hz),
      !turns ? fmt::format("{:.4g} N/m", most) : fmt::format("{:.3g} N·m/rad", max_turn));
}

PassivitySettings passivityOf(const DeviceInfo& device, const LoopDelay& delay) {
  PassivitySettings settings;
  // rounds up part of a tick, to assume the force late rather than early
  settings.delay_ticks = static_cast<std::uint32_t>(std::ceil(std::max(0.0, delay.ticks - 0.05)));
  settings.lag_s = delay.lag_s;
  settings.damping_Ns_per_m = device.limits.damping_Ns_per_m;
  return settings;
}

void noteTool(const Pose& X_HT, const DeviceInfo& device, std::vector<std::string>& notes) {
  if (X_HT == Pose{}) return;
  if (!device.has_orientation)
    notes.push_back(
        "The tool's offset is taken along the axes of the device's base, however the hand turns; its "
        "direction "
        "is not used.");
  else if (lacksTorque(device) && X_HT.p != Vec3{})
    notes.push_back(
        "The handle gets the force at the needle's tip without the torque of its lever: a turn of the hand "
        "moves the tip and is not resisted.");
}

Status fitLesson(StationLesson& lesson, const DeviceInfo& device, const LoopDelay& delay,
                 const StationOptions& options, std::vector<std::string>& notes) {
  const EffectMask before = lesson.scene.effects;
  lesson.scene = forDevice(std::move(lesson.scene), device, notes);
  noteTool(options.X_HT, device, notes);
  RETURN_IF_ERROR(lowerForDevice(lesson, device, delay, options.X_HT, notes));
  if (lesson.scene.effects != before || lesson.shares.lever != 1 || lesson.shares.delay != 1) {
    auto model = compile(lesson.scene, options.rate_hz);
    if (!model.ok())
      return Error{model.error().code, "profile " + lesson.profile.id() + " on the " + device.name + ": " +
                                           model.error().message};
    lesson.model = std::move(*model);
  }
  if (device.renders_force && !delay.is_known)
    notes.push_back(fmt::format(
        "The delay from a reading to its force is assumed to be {:g} ticks, not measured. If it is longer, the "
        "needle can swing in a loose hand. needlelab-station --measure-delay finds it in a minute.",
        delay.ticks));
  const auto unproven = unprovenPassivity(lesson, device, delay, options.X_HT);
  if ((options.passivity_control || unproven) && device.renders_force) {
    lesson.passivity = passivityOf(device, delay);
    notes.push_back("Passivity control is on" + (unproven ? " (" + *unproven + ")" : std::string()) +
                    ": where a force would give the hand more energy than the hand gave, less of it is "
                    "rendered than the model says.");
  }
  return {};
}

}  // namespace needlelab

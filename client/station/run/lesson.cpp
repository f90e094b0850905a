#include "client/station/run/lesson.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "client/device/skilled_hand.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/profile.h"

namespace needlelab {
namespace {

constexpr double kDelayTicks = 1;  // between a reading and the force that it causes

Result<StationLesson> lessonOf(pb::Profile profile, const StationOptions& options) {
  StationLesson lesson;
  if (!options.model.empty())
    if (Status status = chooseModel(profile, options.model); !status.ok()) return status.error();
  auto scene = sceneSpecOf(profile, options.X_WL);
  if (!scene.ok()) return scene.error();
  if (Status status = addCompliance(*scene); !status.ok())
    return Error{status.error().code, "profile " + profile.id() + ": " + status.error().message};
  auto model = compile(*scene, options.rate_hz);
  if (!model.ok()) return Error{model.error().code, "profile " + profile.id() + ": " + model.error().message};
  lesson.warnings = profileWarnings(profile);
  lesson.profile = std::move(profile);
  lesson.scene = std::move(*scene);
  lesson.model = *model;
  return lesson;
}

}  // namespace

Result<StationLesson> lessonOfFile(const StationOptions& options) {
  auto profile = loadProfile(options.profile_file);
  if (!profile.ok()) return profile.error();
  return lessonOf(std::move(*profile), options);
}

Result<StationLesson> lessonOfMessage(const StationOptions& options, const pb::Lesson& message) {
  auto exercise = parseExercise(message.exercise_json(), "exercise " + options.exercise);
  if (!exercise.ok()) return exercise.error();
  auto profile = parseProfile(message.profile_json(), "profile of exercise " + options.exercise);
  if (!profile.ok()) return profile.error();
  auto lesson = lessonOf(std::move(*profile), options);
  if (!lesson.ok()) return lesson;
  lesson->exercise = std::move(*exercise);
  lesson->profile_revision = message.profile_revision();
  lesson->attempt = message.attempt();
  if (message.has_attempts_left()) lesson->attempts_left = message.attempts_left();
  return lesson;
}

LiveAids aidsOf(const AidList& aids) {
  return {hasAid(aids, pb::Exercise::PHASE), hasAid(aids, pb::Exercise::LAYER),
          hasAid(aids, pb::Exercise::DEPTH), hasAid(aids, pb::Exercise::FORCE)};
}

LiveAids aidsOf(const StationLesson& lesson) {
  return aidsOf(lesson.exercise ? aidsOfExercise(*lesson.exercise) : usualAids());
}

std::vector<PlanTarget> targetsOf(const pb::Profile& profile, const Pose& X_WL) {
  std::vector<PlanTarget> targets;
  const auto scene = sceneSpecOf(profile, X_WL);
  const auto entry = scene.ok() ? markedEntry(scene->limb, X_WL) : std::nullopt;
  for (const pb::Target& target : profile.targets()) {
    const pb::Vector3& center = target.center_m();
    targets.push_back({target.name(), X_WL * Vec3{center.x(), center.y(), center.z()}, entry});
  }
  return targets;
}

std::vector<std::string> liveEffects(const SceneModel& model) {
  return effectNames(model.live);
}

Status checkStiffness(const SceneModel& model, const DeviceInfo& device) {
  if (!device.renders_force) return {};
  const auto refuse = [&](const char* what, double wanted, double most, const char* unit) {
    char text[300];
    std::snprintf(
        text, sizeof text,
        "the scene is too stiff for the %s: %s is %.4g %s, the device renders at most %.4g %s; use a softer "
        "profile",
        device.name.c_str(), what, wanted, unit, most, unit);
    return Error{ErrorCode::kInvalidInput, text};
  };
  const double axial = model.axialStiffness_N_per_m();
  if (axial > device.limits.max_stiffness_N_per_m)
    return refuse("wall, friction and the steepest membrane together along the needle", axial,
                  device.limits.max_stiffness_N_per_m, "N/m");
  if (model.isLive(Effect::kClamping) &&
      model.fixture.max_stiffness_N_per_m > device.limits.max_stiffness_N_per_m)
    return refuse("virtual_fixture.max_stiffness_n_per_m", model.fixture.max_stiffness_N_per_m,
                  device.limits.max_stiffness_N_per_m, "N/m");
  if (model.isLive(Effect::kOrientationLimit) &&
      model.orientation.stiffness_Nm_per_rad > device.limits.max_rotational_stiffness_Nm_per_rad)
    return refuse("orientation_limit.stiffness_nm_per_rad", model.orientation.stiffness_Nm_per_rad,
                  device.limits.max_rotational_stiffness_Nm_per_rad, "N·m/rad");
  return {};
}

std::optional<std::string> passivityWarning(const SceneModel& model, const DeviceInfo& device,
                                            double hand_damping_Ns_per_m) {
  if (!device.renders_force) return std::nullopt;
  const double damping = device.limits.damping_Ns_per_m + hand_damping_Ns_per_m;
  // a damper that is computed gives energy as a spring does: its B is taken from what device and hand damp
  // (Colgate and Schenkel: b > KT/2 + B)
  const double own = model.isLive(Effect::kCutting) ? model.axial_damping_Ns_per_m : 0.0;
  const double bound = std::max(0.0, damping - own) / (model.period_s * (0.5 + kDelayTicks));
  const double axial = model.axialStiffness_N_per_m();
  if (axial <= bound) return std::nullopt;
  char minus[60] = "";
  if (own > 0) std::snprintf(minus, sizeof minus, " − %.3g of the model", own);
  char text[400];
  std::snprintf(
      text, sizeof text,
      "%.4g N/m along the needle is above the passivity bound of %.4g N/m ((%.3g + %.3g%s N·s/m)/(%.3g ms · "
      "(½ + %.0f))): it may oscillate in a loose hand",
      axial, bound, device.limits.damping_Ns_per_m, hand_damping_Ns_per_m, minus, model.period_s * 1e3,
      kDelayTicks);
  return text;
}

}  // namespace needlelab

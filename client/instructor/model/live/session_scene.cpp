#include "client/instructor/model/live/session_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/base/text/uuid.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {

Result<Pose> placementOf(const pb::SessionDescription& description) {
  const auto& numbers = description.placement();
  if (numbers.empty()) return Pose{};
  if (numbers.size() != 7 ||
      !std::all_of(numbers.begin(), numbers.end(), [](double v) { return std::isfinite(v); }))
    return Error{ErrorCode::kInvalidInput, "placement: seven finite numbers are needed"};
  const Quat q{numbers[3], numbers[4], numbers[5], numbers[6]};
  if (!(dot(q, q) > 1e-12)) return Error{ErrorCode::kInvalidInput, "placement: the quaternion is zero"};
  return Pose{{numbers[0], numbers[1], numbers[2]}, normalized(q)};
}

StiffnessShares stiffnessSharesOf(const pb::SessionDescription& description) {
  const auto within = [](double share) { return share > 0 && share < 1 ? share : 1; };  // absent: 0
  return {within(description.stiffness_share()), within(description.delay_stiffness_share())};
}

EffectMask leftOut(const pb::SessionDescription& description, const pb::Profile& profile) {
  const auto& listed = profile.effects();
  const auto& live = description.live_effects();
  EffectMask left_out = 0;
  if (live.empty()) return left_out;
  for (const EffectEntry* entry : effectEntries()) {
    if (!entry->on_device.without.empty() &&
        std::find(listed.begin(), listed.end(), numberOfEffect(entry->effect)) != listed.end() &&
        std::find(live.begin(), live.end(), entry->name) == live.end())
      left_out |= bitOf(entry->effect);
  }
  return left_out;
}

void makeAsRendered(const pb::SessionDescription& description, const pb::Profile& profile, SceneSpec& spec) {
  spec.effects &= ~leftOut(description, profile);
  lowerStiffness(spec, stiffnessSharesOf(description));
}

std::string sessionIdText(const std::string& bytes) {
  Uuid id{};
  if (bytes.size() != id.size()) return "?";
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return uuidText(id);
}

SessionScene sceneOfSession(const pb::SessionDescription& description, const ScenePreparer& prepare) {
  SessionScene scene;
  auto profile = parseProfile(description.profile_json(), "the session's profile");
  auto X_WL = placementOf(description);
  if (!profile.ok() || !X_WL.ok()) {
    scene.why = "the scene cannot be shown: " + (profile.ok() ? X_WL.error() : profile.error()).message;
    return scene;
  }
  scene.profile = *std::move(profile);
  scene.X_WL = *X_WL;
  auto view = sceneViewOf(scene.profile, scene.X_WL);
  if (!view.ok()) {
    scene.why = "the scene cannot be shown: " + view.error().message;
    return scene;
  }
  scene.view = std::make_shared<const SceneView>(*std::move(view));
  const auto compiled = [&]() -> Result<SceneModel> {
    ASSIGN_OR_RETURN(auto spec, sceneSpecOf(scene.profile, scene.X_WL));
    makeAsRendered(description, scene.profile, spec);
    if (prepare) {
      RETURN_IF_ERROR(prepare(spec));
    }
    return compile(spec, description.rate_hz());
  };
  auto model = compiled();
  if (!model.ok()) {
    scene.why = "forces by effect cannot be worked out here: " + model.error().message;
    return scene;
  }
  scene.model = std::make_shared<const SceneModel>(*std::move(model));
  return scene;
}

GestureTrace traceOf(const SessionScene& scene, double span_s, double ticks_per_sample) {
  const Anatomy anatomy = anatomyOf(scene.profile, scene.X_WL);
  return GestureTrace(span_s, BoneContacts(scene.profile, anatomy), ticks_per_sample,
                      GestureAlarms(scene.profile, anatomy, {}));
}

}  // namespace needlelab

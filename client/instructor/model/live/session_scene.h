/// Makes a scene for drawing and stepping from a session's description (bytes from the network).
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "client/view/model/gesture_trace.h"
#include "client/view/model/scene_view.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "needlelab/profile.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Completes a scene before it is compiled: adds the FEM compliance (addCompliance).
using ScenePreparer = std::function<Status(SceneSpec&)>;

struct SessionScene {
  pb::Profile profile;
  Pose X_WL;
  std::shared_ptr<const SceneView> view;    ///< null if the description has no readable profile
  std::shared_ptr<const SceneModel> model;  ///< null if the engine cannot step it here
  std::string why;                          ///< why one of them is null, for people; otherwise empty
};

/// Makes as much of the scene as the description allows. Thread: any.
SessionScene sceneOfSession(const pb::SessionDescription& description, const ScenePreparer& prepare = {});

/// Returns a trace with the scene's bones and hazards; without them if the profile is not readable. `span_s`,
/// `ticks_per_sample`: GestureTrace's.
GestureTrace traceOf(const SessionScene& scene, double span_s, double ticks_per_sample = 1);

/// Returns the description's placement; identity if it has none. Errors: kInvalidInput if it is not 7 finite
/// numbers.
Result<Pose> placementOf(const pb::SessionDescription& description);

/// Returns the shares of the profile's stiffness that the session was rendered with; 1 where the description
/// has none or it is outside (0, 1].
StiffnessShares stiffnessSharesOf(const pb::SessionDescription& description);

/// Returns the profile's effects that the station omitted because its device and tool cannot hold them
/// (BONE). None if the description has no list of live effects.
EffectMask leftOut(const pb::SessionDescription& description, const pb::Profile& profile);

/// Turns the profile's scene into the rendered one: scales its stiffness by that share, and removes what
/// was omitted.
void makeAsRendered(const pb::SessionDescription& description, const pb::Profile& profile, SceneSpec& spec);

/// The trainee for people: the full name if the server knows it. Of a session's description or a station's
/// status.
template <typename OfTrainee>
const std::string& traineeName(const OfTrainee& of) {
  return of.trainee_full_name().empty() ? of.trainee() : of.trainee_full_name();
}

/// Returns the session's id as text; "?" if it is invalid.
std::string sessionIdText(const std::string& bytes);

}  // namespace needlelab

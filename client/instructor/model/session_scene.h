/// Makes a scene for drawing and stepping from a session's description (bytes from the network).
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "client/view/model/gesture_trace.h"
#include "client/view/model/scene_view.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "needlelab/profile.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Completes a scene before its compilation: adds FEM's compliance (addCompliance).
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

/// A trace with the scene's bones and hazards; none where the profile is not readable. `span_s`,
/// `ticks_per_sample`: GestureTrace's.
GestureTrace traceOf(const SessionScene& scene, double span_s, double ticks_per_sample = 1);

/// Returns the description's placement; identity if it has none. Errors: kInvalidInput if it is not 7 finite
/// numbers.
Result<Pose> placementOf(const pb::SessionDescription& description);

/// The share of the profile's stiffness across the needle that the session was rendered with; 1 where the
/// description has none, or a number that is not of (0, 1].
double stiffnessShareOf(const pb::SessionDescription& description);

/// Whether the station left out the profile's BONE: its device and tool do not hold it. False where the
/// description has no list of live effects.
bool leftBoneOut(const pb::SessionDescription& description, const pb::Profile& profile);

/// Makes of the profile's scene the one that was rendered: stiff by that share, and without bone where it was
/// left out.
void makeAsRendered(const pb::SessionDescription& description, const pb::Profile& profile, SceneSpec& spec);

/// Returns the session's id as text; "?" if it is invalid.
std::string sessionIdText(const std::string& bytes);

}  // namespace needlelab

/// From a session's description (bytes of the network) to a scene that can be drawn and stepped.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "client/view/model/scene_view.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "needlelab/profile.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Adds to a scene what it needs before it can be compiled: FEM's compliance
/// (addCompliance).
using ScenePreparer = std::function<Status(SceneSpec&)>;

struct SessionScene {
  pb::Profile profile;
  Pose X_WL;
  std::shared_ptr<const SceneView> view;    ///< null where the description has no readable profile
  std::shared_ptr<const SceneModel> model;  ///< null where the engine cannot step it here
  std::string why;                          ///< why one of them is null, for people; else empty
};

/// As much of the scene as the description allows. Thread: any.
SessionScene sceneOfSession(const pb::SessionDescription& description, const ScenePreparer& prepare = {});

/// The description's placement; identity where it has none. kInvalidInput: not 7 finite numbers.
Result<Pose> placementOf(const pb::SessionDescription& description);

/// The session's id as text; "?" when it is not one.
std::string sessionIdText(const std::string& bytes);

}  // namespace needlelab

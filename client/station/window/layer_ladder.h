/// The layers one under the other, with the tip among them.
#pragma once

#include <imgui/imgui.h>

#include "client/view/model/aids.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

/// How deep the ladder reaches: a fifth beyond the deepest target, or else the layers' end or the needle's
/// length, whichever is less. In m.
double ladderDepth_m(const SceneView& scene);

/// Names stand there with Aid LAYER, the tip's place with DEPTH, targets with ANATOMY. Nothing of it: nothing
/// is drawn.
void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px);

}  // namespace needlelab

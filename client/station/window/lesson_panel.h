/// The side panel of a lesson: figures, the ladder of layers, plots. Each is shown only with its aid.
#pragma once

#include <imgui/imgui.h>

#include "client/station/window/lesson_board.h"
#include "client/station/window/lesson_follow.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/scene_view.h"
#include "client/view/ultrasound_view.h"

namespace needlelab {

/// How deep the ladder reaches: a fifth beyond the deepest target, or else the layers' end or the needle's
/// length, whichever is less. In m.
double ladderDepth_m(const SceneView& scene);

/// Names stand there with Aid LAYER, the tip's place with DEPTH, targets with ANATOMY. Nothing of it: nothing
/// is drawn.
void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px);

/// Figures, ladder, ultrasound and plots, each only with its aid.
void lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px);

}  // namespace needlelab

/// A lesson's side panel: figures, the ladder of layers, plots. Each appears only with its aid.
#pragma once

#include <imgui/imgui.h>

#include "client/station/window/lesson_board.h"
#include "client/station/window/lesson_follow.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/scene_view.h"
#include "client/view/ultrasound_view.h"

namespace needlelab {

/// Returns the ladder's depth in m: a fifth beyond the deepest target; without targets the end of the layers
/// or the needle's length, whichever is less.
double ladderDepth_m(const SceneView& scene);

/// Shows names with Aid LAYER, the tip with DEPTH, targets with ANATOMY. Draws nothing without these aids.
void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px);

/// Draws figures, ladder, ultrasound and plots, each only with its aid.
void lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px);

}  // namespace needlelab

/// A lesson's side panel: figures, the ladder of layers, plots. Each appears only with its aid.
#pragma once

#include <span>
#include <vector>

#include <imgui/imgui.h>

#include "client/station/window/lessons/lesson_board.h"
#include "client/station/window/screens/lesson_follow.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/scene_view.h"
#include "client/view/ultrasound_view.h"

namespace needlelab {

/// Returns the ladder's depth in m: a fifth beyond the deepest target; without targets, the end of the layers
/// or the needle's length, whichever is less.
double ladderDepth_m(const SceneView& scene);

/// Shows names with Aid LAYER, the tip with DEPTH, targets with ANATOMY. Draws nothing without these aids.
void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px);

/// Returns the widths of columns for cells of these widths, placed row by row in `room_px`: all in one row,
/// or in half as many columns until every cell fits. Shares out the remaining width; each column is followed
/// by `gap_px`. A single column takes all the room, even if a cell needs more.
std::vector<float> cellColumns(std::span<const float> needed_px, float gap_px, float room_px);

/// Draws figures, ladder, ultrasound and plots, each only with its aid, and the station's light. Returns
/// whether the light was clicked.
bool lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px);

}  // namespace needlelab

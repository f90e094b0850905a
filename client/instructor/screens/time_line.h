/// A recording as one line: where the replay is, its loop, events and remarks.
#pragma once

#include <imgui/imgui.h>

#include <vector>

#include "client/instructor/model/replay_player.h"
#include "client/instructor/model/stored_gesture.h"

namespace needlelab {

/// A click or drag seeks; with Shift a drag marks a loop. Marks have signs, and their words when the mouse is
/// near.
void timeLine(ReplayPlayer& player, const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks,
              float height_px);

}  // namespace needlelab

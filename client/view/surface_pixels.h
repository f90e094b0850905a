/// From ImGui's coordinates to OpenGL's, for callbacks that draw by themselves. Private to this folder.
#pragma once

#include <imgui/imgui.h>

#include "client/view/frame_buffer.h"

namespace needlelab {

/// The rectangle in pixels of what is bound for drawing (whose viewport is the whole), counted from below, as
/// far as it lies within `clip` (left, top, right, bottom). ImGui counts from above, and in points where the
/// display scales.
PixelRect surfacePixels(ImVec2 from, ImVec2 to, ImVec4 clip);

}  // namespace needlelab

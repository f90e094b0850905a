/// Force over depth of a whole gesture, with the layers behind it.
#pragma once

#include <imgui/imgui.h>

#include "client/station/run/gesture_curve.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

/// What of a gesture the plot can show: from 10 mm outside to the deepest point, up to the greatest force.
/// Pure.
struct DepthPlotRange {
  double from_m = -0.01, to_m = 0.01;
  double force_N = 1;
};
DepthPlotRange depthPlotRange(const GestureCurve& curve, const SceneView& scene);

/// Going in is drawn in one colour, coming out in another; layers are bands with their names, targets are
/// marked.
void depthPlot(const GestureCurve& curve, const SceneView& scene, ImVec2 size_px);

}  // namespace needlelab

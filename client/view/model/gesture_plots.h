/// The usual plots of a gesture, in both windows and the report.
#pragma once

#include <cstdint>

#include "client/view/model/gesture_trace.h"
#include "client/view/model/plot.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

enum class GesturePlot : std::uint8_t {
  kForces,  ///< by effect, and the total
  kDepth,   ///< with the layers as bands, downward, the target as a dashed line
  kSpeed,
  kAlignment,  ///< lateral error
  kAngles,     ///< α and the needle's tilt
  kPlaces,     ///< tip and wall per axis (the paper's Fig. 8 and 9)
  kPlunger,
};
/// The plot refers to `trace` and `scene` (null: unknown), which must live while the plot is drawn. Its marks
/// are the trace's events in the range.
Plot gesturePlot(GesturePlot which, const GestureTrace& trace, const SceneView* scene, double from_s,
                 double to_s);

}  // namespace needlelab

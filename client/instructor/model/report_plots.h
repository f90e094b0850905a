/// The plots of a gesture as a report shows them: the same as in the windows.
#pragma once

#include <vector>

#include "client/instructor/model/stored_gesture.h"
#include "client/instructor/model/svg_plot.h"

namespace needlelab {

/// Forces by effect, depth with layers and remarks, speed, lateral error, angles. Refer to `gesture`.
std::vector<SvgPlot> reportPlots(const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks);

}  // namespace needlelab

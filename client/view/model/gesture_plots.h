/// The usual plots of a gesture, for both windows and the report.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/view/model/gesture_trace.h"
#include "client/view/model/plot.h"
#include "client/view/model/scene_view.h"
#include "common/scoring/measures/measures.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

enum class GesturePlot : std::uint8_t {
  kForces,  ///< by effect, and the total
  kDepth,   ///< downward, with the tissues and targets as bands: in a body those of each insertion
  kSpeed,
  kAlignment,  ///< distance from the line that the needle set at its entry
  kAngles,     ///< α, and the needle's tilt from its own line
  kPlaces,     ///< tip and wall per axis (the paper's Figs. 8 and 9)
  kPlunger,
};
/// The plot refers to `trace` and `scene` (null: unknown), which must live while it is drawn. Its marks are
/// the trace's events in the range.
Plot gesturePlot(GesturePlot which, const GestureTrace& trace, const SceneView* scene, double from_s,
                 double to_s);

/// An exercise's requirement on a measure, in the measure's SI unit.
struct PlotRequirement {
  std::string measure;  ///< "peak_force_n"
  std::optional<double> min, max;
};
std::vector<PlotRequirement> requirementsOf(const pb::Exercise& exercise);
/// Requirements of the score rows that have one.
std::vector<PlotRequirement> requirementsOf(std::span<const Measure> measures);
/// Adds the limits of the measures that judge the plotted quantity, e.g. "at most 5 N" of peak_force_n to
/// kForces. The peak speed is the tip's in any direction, and its line says so; kSpeed shows the component
/// along the needle, so its line is on both sides of zero. No measure judges angles.
void addLimits(Plot& plot, GesturePlot which, std::span<const PlotRequirement> requirements);
/// Adds one measure's limits, in shown units: SI times `shown_per_si`.
void addLimits(Plot& plot, const PlotRequirement& requirement, double shown_per_si);

}  // namespace needlelab

/// The physical needle: its gauge, its tip, and the place of its opening. Values that a scene leaves out are
/// 0 or kUnknown and have no effect.
#pragma once

#include <cstdint>

namespace needlelab {

/// In the order of needlelab.pb.Needle.Tip.
enum class NeedleTip : std::uint8_t { kUnknown, kHypodermic, kQuincke, kTuohy, kPencilPoint };

struct NeedleSpec {
  double length_m = 0.06;       ///< (0, 1]
  double outer_diameter_m = 0;  ///< 0: unknown
  NeedleTip tip = NeedleTip::kUnknown;
  double bevel_angle_rad = 0;  ///< between bevel (pencil point: cone) and axis; 0: the tip's usual one
};

/// Gauges with a defined size: 10 (thickest) to 34.
inline constexpr int kThickestGauge = 10, kThinnestGauge = 34;
/// Tolerance of a diameter for its gauge: less than half the distance to the next gauge, more than the
/// tolerance of real tubes (a 23G tube is 0.60-0.67 mm).
inline constexpr double kGaugeTolerance = 0.08;

/// Outer diameter of a gauge: the designated metric size of ISO 9626:2016, e.g. 0.7 mm for 22. Returns 0 for
/// other numbers.
double gaugeDiameter_m(int gauge);

/// Returns the given angle, otherwise the usual angle for the tip's type (all but the first are our own
/// choice): hypodermic 11° (ISO 7864's long bevel), Quincke 20°, Tuohy 25°, pencil point 10° (half the cone's
/// angle). 0 if neither is known.
double bevelAngle_rad(const NeedleSpec& needle);

/// Length of the bevel, or of a pencil point's cone, along the axis: d/tan β, and d/(2 tan β). 0 when
/// unknown.
double bevelLength_m(const NeedleSpec& needle);

/// Returns the distance along the axis from the tip back to the middle of the opening: half of the bevel,
/// d/(2 tan β); for a pencil point the side port, assumed one diameter behind the cone, d/(2 tan β) + d. 0 if
/// diameter or angle is unknown: then an injection's place is the tip.
double openingBehindTip_m(const NeedleSpec& needle);

}  // namespace needlelab

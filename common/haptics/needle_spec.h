/// The needle as a thing: its gauge, its tip, and where its opening is. What a scene may leave out is 0 or
/// kUnknown here, and changes nothing.
#pragma once

#include <cstdint>

namespace needlelab {

/// In the order of needlelab.pb.Needle.Tip.
enum class NeedleTip : std::uint8_t { kUnknown, kHypodermic, kQuincke, kTuohy, kPencilPoint };

struct NeedleSpec {
  double length_m = 0.06;       ///< (0, 1]
  double outer_diameter_m = 0;  ///< 0: not known
  NeedleTip tip = NeedleTip::kUnknown;
  double bevel_angle_rad = 0;  ///< between bevel (pencil point: cone) and axis; 0: the tip's usual one
};

/// Gauges that have a size: 10 (thickest) to 34.
inline constexpr int kThickestGauge = 10, kThinnestGauge = 34;
/// How far a diameter may be from its gauge's and still be called that: less than half of the way to the
/// next one, more than real tubes differ (a 23G tube is 0.60-0.67 mm).
inline constexpr double kGaugeTolerance = 0.08;

/// Outer diameter of a gauge: the designated metric size of ISO 9626:2016, e.g. 0.7 mm for 22. 0 for a number
/// that is not a gauge.
double gaugeDiameter_m(int gauge);

/// The angle as given, or else the usual one of such a tip (set by hand but the first): hypodermic 11° (ISO
/// 7864's long bevel), Quincke 20°, Tuohy 25°, pencil point 10° (half the cone's). 0 when neither is known.
double bevelAngle_rad(const NeedleSpec& needle);

/// Length of the bevel, or of a pencil point's cone, along the axis: d/tan β, and d/(2 tan β). 0 when it is
/// not known.
double bevelLength_m(const NeedleSpec& needle);

/// How far behind the tip, along the axis, the middle of the opening is: half of the bevel, d/(2 tan β); of a
/// pencil point its side port, taken one diameter behind the cone, d/(2 tan β) + d. 0 when diameter or angle
/// are not known: then the place of an injection is the tip.
double openingBehindTip_m(const NeedleSpec& needle);

}  // namespace needlelab

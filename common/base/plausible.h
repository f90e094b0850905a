/// Whether a number read from people's files and options can be in the unit that its name says: the one table
/// of what needles, hands and instruments do. Pure.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

enum class Quantity : std::uint8_t {
  kTool,       ///< from the handle's origin to the tip, in m
  kPlacement,  ///< of the limb in the device's frame, in m
  kWay,        ///< along one axis, of a handle or a tip, in m
  kDepth,      ///< of a tip below the skin, in m
  kStep,       ///< the usual time between two rows, in s
  kTime,       ///< of a curve, in s
  kSpeed,      ///< of an insertion, in m/s
  kDiameter,   ///< of a needle, in m
  kForce,      ///< on a needle, in N
  kShare,      ///< of a plunger's way, 0 to 1
};

/// Empty if |value| is not beyond the quantity's row. Otherwise a sentence for people, with the likely unit:
/// "40 m: at most 2 m is plausible; looks like millimetres: 40 millimetres are 0.04 m".
std::string implausible(Quantity quantity, double value);
/// kInvalidInput, "WHERE is …", if the value is implausible.
Status checkPlausible(std::string_view where, Quantity quantity, double value);
/// As checkPlausible, for the median step of ascending times; fewer than 50 are poses of a plan, which may be
/// far apart.
Status checkTimeStep(std::string_view where, std::span<const double> t_s);

}  // namespace needlelab

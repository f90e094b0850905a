/// Random scenes and gestures for the passivity observer: the same seed gives the same gesture everywhere.
#pragma once

#include <cstdint>
#include <string_view>

#include "client/sim/stability/passivity_gesture.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

enum class LimbShape : std::uint8_t { kPlane, kSphere, kCapsule };
inline constexpr std::array<std::string_view, 3> kLimbShapeNames = {"plane", "sphere", "capsule"};

/// What gestures are drawn from. The ranges are those of a hand at a needle: speed at most 0.15 m/s.
struct GestureRange {
  double most_depth_m = 0.045, most_aside_m = 0.012;
  double most_speed_mps = 0.15, most_turn_radps = 6;
  double most_tilt = 0.9;          ///< tangent; grazing strokes lie at 80-86° whatever this says
  double all_effects_share = 0.7;  ///< the others have a random set of effects
  ClampingMode clamping = ClampingMode::kPassive;
  int fewest_strokes = 3, most_strokes = 12;
};

/// A random scene and gesture. Starts and ends outside. Numbers have three significant digits, so that what
/// is written to a file is what was run.
PassivityGesture randomGesture(std::uint64_t seed, LimbShape shape, const GestureRange& range = {});

}  // namespace needlelab

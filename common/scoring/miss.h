/// By how much the needle missed the target: for the trainee, from the recording alone. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/anatomy.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A point beside the nearest target, or in it.
struct Miss {
  /// Which point of the gesture it is.
  enum class At : std::uint8_t {
    kFurthest,   ///< the tip, at the furthest point of the last insertion
    kInjection,  ///< the needle's opening, where the last injection in tissue began
  };
  At at = At::kFurthest;
  bool in_target = false;
  /// From the edge of the target's ball, once the point is moved along the skin's normal to a depth of the
  /// target; 0: it only has the wrong depth.
  double aside_m = 0;
  /// Beyond the depths of the target: greater than 0 is too deep, less is too shallow.
  double too_deep_m = 0;
  /// False: the target holds the middle of the limb, where depth has no direction; `aside_m` is all of it.
  bool has_depth = true;
  /// The profile's names of the directions along which it lies aside, the nearest first, at most three: those
  /// within 67.5° (as north-north-east is north and east). Empty where the nearest direction has no name.
  std::vector<std::string> towards;
};

/// Of a point in W. `anatomy`: of the profile at `X_WL`, with a target at least.
Miss missAt(const Anatomy& anatomy, const pb::Directions& directions, const Pose& X_WL, Vec3 p_W_m);

/// Of a gesture: where the last injection in tissue began; without one, at the furthest point of the last
/// insertion. `events`: the gesture's, as from syringeEvents. Nothing where the profile has no target, or the
/// needle was never in tissue.
std::optional<Miss> missOf(std::span<const GestureSample> samples, std::span<const pb::SyringeEvent> events,
                           const pb::Profile& profile, const Pose& X_WL);

/// "Missed by 2.1 mm towards the head, 3.9 mm too deep." or "In the target."
std::string missText(const Miss& miss);
/// Which point that is, as a sentence: "Where the last injection began, at the needle's opening."
std::string missPlaceText(const Miss& miss);

}  // namespace needlelab

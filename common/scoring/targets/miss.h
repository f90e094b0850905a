/// How far the needle missed the target, for the trainee, computed from the recording alone. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/needle_way.h"
#include "needlelab/event.pb.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A point beside or in the nearest target.
struct Miss {
  /// Which point of the gesture it is.
  enum class At : std::uint8_t {
    kFurthest,   ///< the tip, at the furthest point of the last insertion
    kInjection,  ///< the needle's opening, where the last injection in tissue began
  };
  At at = At::kFurthest;
  bool in_target = false;
  /// The hazards that the needle came through.
  std::vector<std::string> through;
  /// Along the needle (OffTarget): above 0, it is too deep; below 0, too shallow.
  double too_deep_m = 0;
  /// From the target's edge to where the needle's line comes nearest; 0: only the depth is wrong.
  double aside_m = 0;
  /// The profile's names for the directions of `aside_m`, nearest first, at most three: those within 67.5°
  /// (as north-north-east is north and east). Empty if the nearest direction has no name.
  std::vector<std::string> towards;
};

/// The miss of a point of a needle. `anatomy`: the profile's at `X_WL`, with at least one target.
Miss missAt(const Anatomy& anatomy, const pb::Directions& directions, const Pose& X_WL, const NeedleWay& way);

/// The miss of a gesture: where the last injection in tissue began; without one, at the furthest point of the
/// last insertion. `events`: the gesture's, as from syringeEvents. Empty if the profile has no target or the
/// needle was never in tissue.
std::optional<Miss> missOf(std::span<const GestureSample> samples, std::span<const pb::SyringeEvent> events,
                           const pb::Profile& profile, const Pose& X_WL);

/// "Missed by 2.1 mm towards the head, 3.9 mm too deep.", "Through the dural sac, 19.4 mm too deep." or "In
/// the target."
std::string missText(const Miss& miss);
/// Which point that is, as a sentence: "Where the last injection began, at the needle's opening."
std::string missDirectionText(const Miss& miss);

}  // namespace needlelab

/// The straight way of a needle from the skin, and what lies on it: the part of a target that a needle can be
/// in, and the hazards that it came through. Pure functions, for measures, events of the syringe and misses.
///
/// A target that surrounds others (the epidural space, a tendon's sheath) lies on a needle's way twice. From
/// the first hazard that the needle meets beside the target, behind its near side, nothing is the target any
/// more: a needle that came through the dural sac is not in the epidural space in front of it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/anatomy/anatomy.h"

namespace needlelab {

/// From the skin along the needle to a point of it. In W.
struct NeedleWay {
  Vec3 skin_W_m;        ///< where the shaft comes out of the skin
  Vec3 axis_W;          ///< unit, from hub to tip
  double length_m = 0;  ///< from the skin to the point, below 0 outside

  /// The place at this distance from the skin.
  [[nodiscard]] Vec3 at(double from_skin_m) const { return skin_W_m + from_skin_m * axis_W; }
  [[nodiscard]] Vec3 end() const { return at(length_m); }
};

/// The way to the tip, or to a point `behind_tip_m` behind it.
NeedleWay wayOf(const GestureSample& sample, double behind_tip_m = 0);

/// The names of the hazards that the shaft touches between skin and end.
std::vector<std::string> hazardsOn(const Anatomy& anatomy, const NeedleWay& way);

/// How far the way's end is from a target, along the way and across it.
struct OffTarget {
  /// Above 0: the needle has to come back by this much to be in the target; below 0: to go deeper. If its
  /// line misses the target, to where the line comes nearest.
  double too_deep_m = 0;
  /// From the target's edge to where the line comes nearest; 0 if the line meets the target.
  double aside_m = 0;
  Vec3 aside_W;  ///< which way, unit, from the target to the line; 0 if the line meets it
};
OffTarget offTarget(const Anatomy& anatomy, const Target& target, const NeedleWay& way);
/// The way's end from the target's edge, negative inside: as distanceTo, but along the way, and above 0,
/// where a hazard lies between.
double distanceOn(const Anatomy& anatomy, const Target& target, const NeedleWay& way);

/// Whether a way ends in one of the targets, and no hazard lies between the target's near side and the end.
/// Whether one does is asked again when the needle has moved by 50 µm since the last call.
class InTarget {
 public:
  /// `anatomy` must outlive it.
  explicit InTarget(const Anatomy& anatomy) : anatomy_(&anatomy), asked_(anatomy.targets.size()) {}
  bool operator()(const NeedleWay& way);

 private:
  struct Asked {
    Vec3 skin_W_m, end_W_m;
    std::optional<bool> behind;  ///< empty: not asked yet
  };
  const Anatomy* anatomy_;
  std::vector<Asked> asked_;  // by target
};

}  // namespace needlelab

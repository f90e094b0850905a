#include <algorithm>
#include <limits>

#include "common/scoring/groups.h"

namespace needlelab {
namespace {

Vec3 tipOf(const GestureSample& s) {
  return {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
}

/// The shaft's point at the skin: back from the tip by the inserted length, along the needle.
Vec3 skinPointOf(const GestureSample& s) {
  const Vec3 axis = zAxis(normalized(Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]}));
  return tipOf(s) - s.insertion_m * axis;
}

/// Distance of the tip from the nearest target's centre, and whether it is in that target.
struct Aim {
  double distance_m = std::numeric_limits<double>::infinity();
  bool reached = false;
};

Aim aimOf(const Anatomy& anatomy, Vec3 tip_W_m) {
  Aim aim;
  for (const Region& target : anatomy.targets) {
    const double distance_m = norm(tip_W_m - target.a_W_m);
    aim.distance_m = std::min(aim.distance_m, distance_m);
    aim.reached = aim.reached || distance_m <= target.radius_m;
  }
  return aim;
}

/// The furthest point of the last insertion: where the needle was taken to, before it was drawn out. False:
/// never in tissue.
bool finalPoint(const Gesture& gesture, std::size_t& index) {
  bool found = false, was_inside = false;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    const bool inside = isInside(gesture.samples[i]);
    if (inside && (!was_inside || gesture.samples[i].insertion_m >= gesture.samples[index].insertion_m)) {
      index = i;
      found = true;
    }
    was_inside = inside;
  }
  return found;
}

void addTargets(const Gesture& gesture, Rows& rows) {
  double nearest_m = std::numeric_limits<double>::infinity(), time_s = 0;
  bool reached = false;
  for (std::size_t i = 0; i < gesture.samples.size(); ++i) {
    if (!isInside(gesture.samples[i])) continue;
    const Aim aim = aimOf(gesture.anatomy, tipOf(gesture.samples[i]));
    nearest_m = std::min(nearest_m, aim.distance_m);
    if (!aim.reached) continue;
    reached = true;
    time_s += gesture.weight_s(i);
  }
  rows.add("target_reached", reached ? 1 : 0);
  rows.add("time_at_target_s", time_s);
  std::size_t last = 0;
  if (!finalPoint(gesture, last)) return;
  rows.add("target_distance_m", aimOf(gesture.anatomy, tipOf(gesture.samples[last])).distance_m);
  rows.add("target_nearest_m", nearest_m);
}

}  // namespace

/// Counted while the tip is in tissue.
/// - `target_reached` (1 or 0): the tip was within a target's radius of its centre. `time_at_target_s`: for
/// how long in all.
/// - `target_distance_m`: of the tip from the nearest target's centre at the furthest point of the last
/// insertion;
///   `target_nearest_m`: the least at any time.
/// - `hazards_touched`: how many hazards the tip or the shaft in tissue (straight back along the needle) came
/// to.
void addAim(const Gesture& gesture, Rows& rows) {
  const std::vector<Region>& hazards = gesture.anatomy.hazards;
  std::vector<bool> touched(hazards.size(), false);
  for (const GestureSample& sample : gesture.samples) {
    if (!isInside(sample)) continue;
    const Vec3 tip = tipOf(sample), skin = skinPointOf(sample);
    for (std::size_t h = 0; h < hazards.size(); ++h) {
      if (!touched[h] && distanceTo(hazards[h], tip, skin) <= 0) touched[h] = true;
    }
  }
  std::string names;
  for (std::size_t h = 0; h < hazards.size(); ++h) {
    if (touched[h]) names += (names.empty() ? " (" : ", ") + hazards[h].name;
  }
  rows.add("hazards_touched", static_cast<double>(std::count(touched.begin(), touched.end(), true)),
           "Hazards touched" + (names.empty() ? names : names + ")"));
  if (!gesture.anatomy.targets.empty()) addTargets(gesture, rows);
}

}  // namespace needlelab

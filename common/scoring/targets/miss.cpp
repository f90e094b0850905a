#include "common/scoring/targets/miss.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>

#include "common/base/text/text.h"
#include "common/haptics/surface.h"
#include "common/scoring/anatomy/structure_region.h"
#include "common/scoring/measures/measure_groups.h"

namespace needlelab {
namespace {

/// sin 22.5°: a direction further than 67.5° away is not named.
constexpr double kNamed = 0.3826834323650898;
/// Smaller values read as "0.0 mm".
constexpr double kShown_m = 0.05e-3;

/// Whether a ball extends across the middle of a limb, where depths end and the skin's normal reverses. In a
/// volume, where depth no longer grows straight in from the ball's centre to its end.
bool containsCentre(const Anatomy& anatomy, const Region& ball) {
  if (std::holds_alternative<BodyLimb>(anatomy.limb)) {
    constexpr double kGrows = 0.9;
    const Vec3 in = -surfaceNormal(anatomy.limb, ball.a_W_m, {0, 0, -1});
    const double grown_m = depthAt(anatomy, ball.a_W_m + in * ball.radius_m) - depthAt(anatomy, ball.a_W_m);
    return grown_m < kGrows * ball.radius_m;
  }
  const double reach_m = depthAt(anatomy, ball.a_W_m) + ball.radius_m;
  if (const auto* sphere = std::get_if<SphereLimb>(&anatomy.limb)) return reach_m > sphere->radius_m;
  if (const auto* capsule = std::get_if<CapsuleLimb>(&anatomy.limb)) return reach_m > capsule->radius_m;
  return false;
}

/// How far a depth is outside a span: above 0 too deep, below 0 too shallow.
double beyond(DepthSpan span, double depth_m) {
  return depth_m > span.bottom_m ? depth_m - span.bottom_m : std::min(0.0, depth_m - span.top_m);
}

/// How far a depth is outside the nearest of the target's depth spans: the ball's, limited to one of the
/// tissues.
double tooDeep(const Anatomy& anatomy, const Target& target, double depth_m) {
  const double at_m = depthAt(anatomy, target.ball.a_W_m);
  const DepthSpan ball{at_m - target.ball.radius_m, at_m + target.ball.radius_m};
  if (target.tissue_region != nullptr) {
    const DepthSpan span = depthSpanOf(anatomy, target);
    return beyond(span.top_m < span.bottom_m ? span : ball, depth_m);
  }
  if (target.tissues.empty()) return beyond(ball, depth_m);
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const DepthSpan& tissue : target.tissues) {
    const DepthSpan span{std::max(ball.top_m, tissue.top_m), std::min(ball.bottom_m, tissue.bottom_m)};
    if (span.top_m > span.bottom_m) continue;
    const double found_m = beyond(span, depth_m);
    if (std::abs(found_m) < std::abs(nearest_m)) nearest_m = found_m;
  }
  return std::isfinite(nearest_m) ? nearest_m : beyond(ball, depth_m);
}

/// The names of the directions that a vector in L points to.
std::vector<std::string> namesOf(const pb::Directions& directions, Vec3 way_L) {
  std::vector<std::string> names;
  const double length = norm(way_L);
  if (!(length > 0)) return names;
  const Vec3 u = way_L / length;
  std::array<std::pair<double, const std::string*>, 6> all{{{u.x, &directions.plus_x()},
                                                            {-u.x, &directions.minus_x()},
                                                            {u.y, &directions.plus_y()},
                                                            {-u.y, &directions.minus_y()},
                                                            {u.z, &directions.plus_z()},
                                                            {-u.z, &directions.minus_z()}}};
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  if (all.front().second->empty()) return names;
  for (const auto& [share, name] : all)
    if (share >= kNamed && !name->empty()) names.push_back(*name);
  return names;
}

std::string mm(double metres) {
  return fixedText(1e3 * metres, 1) + " mm";
}

}  // namespace

Miss missAt(const Anatomy& anatomy, const pb::Directions& directions, const Pose& X_WL, Vec3 p_W_m) {
  const auto distance = [&](const Target& target) { return distanceTo(anatomy, target, p_W_m); };
  const Target& target = *std::ranges::min_element(anatomy.targets, {}, distance);
  const Vec3 center = target.ball.a_W_m;
  const Quat to_L = conjugate(normalized(X_WL.q));
  Miss miss;
  miss.in_target = distance(target) <= 0;
  if (miss.in_target) return miss;
  if (target.ball.structure != nullptr) {
    // from the structure's nearest point, along the skin's normal and across it
    const Vec3 nearest = target.ball.structure->nearest(p_W_m), way = p_W_m - nearest;
    const Vec3 normal = surfaceNormal(anatomy.limb, p_W_m, nearest - p_W_m);
    miss.too_deep_m = -dot(way, normal);
    const Vec3 across = way + miss.too_deep_m * normal;
    miss.aside_m = norm(across);
    miss.towards = namesOf(directions, rotate(to_L, across));
    return miss;
  }
  if (!anatomy.has_limb || containsCentre(anatomy, target.ball)) {
    miss.has_depth = false;
    miss.aside_m = distance(target);
    miss.towards = namesOf(directions, rotate(to_L, p_W_m - center));
    return miss;
  }
  const Vec3 inward = center - p_W_m;  // at the middle of the limb, where the skin has no normal
  miss.too_deep_m = tooDeep(anatomy, target, depthAt(anatomy, p_W_m));
  const Vec3 at_depth = p_W_m + miss.too_deep_m * surfaceNormal(anatomy.limb, p_W_m, inward);
  miss.aside_m = std::max(0.0, distanceTo(target.ball, at_depth));
  const Vec3 normal = surfaceNormal(anatomy.limb, center, inward), way = at_depth - center;
  miss.towards = namesOf(directions, rotate(to_L, way - dot(way, normal) * normal));
  return miss;
}

std::optional<Miss> missOf(std::span<const GestureSample> samples, std::span<const pb::SyringeEvent> events,
                           const pb::Profile& profile, const Pose& X_WL) {
  const Anatomy anatomy = anatomyOf(profile, X_WL);
  if (anatomy.targets.empty()) return std::nullopt;
  const pb::SyringePlace* injection = nullptr;
  for (const pb::SyringeEvent& event : events)
    if (event.kind() == pb::SyringeEvent::INJECTION && event.begin().in_tissue()) injection = &event.begin();
  if (injection != nullptr) {
    Miss miss =
        missAt(anatomy, profile.directions(), X_WL, {injection->x_m(), injection->y_m(), injection->z_m()});
    miss.at = Miss::At::kInjection;
    return miss;
  }
  const RecordedSamples usable(samples);
  FinalPoint furthest;
  for (std::size_t i = 0; i < usable.size(); ++i) furthest.add(usable[i], i);
  if (!furthest.index) return std::nullopt;
  return missAt(anatomy, profile.directions(), X_WL, tipOf(usable[*furthest.index]));
}

std::string missText(const Miss& miss) {
  if (miss.in_target) return "In the target.";
  std::string aside, depth;
  if (miss.aside_m >= kShown_m) {
    aside = " by " + mm(miss.aside_m);
    const char* before = " ";
    for (const std::string& name : miss.towards) {
      aside += before + name;
      before = " and ";
    }
    if (miss.towards.empty() && miss.has_depth) aside += " to the side";
  }
  if (std::abs(miss.too_deep_m) >= kShown_m)
    depth = mm(std::abs(miss.too_deep_m)) + (miss.too_deep_m > 0 ? " too deep" : " too shallow");
  if (aside.empty() && depth.empty()) return "Missed by less than 0.1 mm.";
  if (aside.empty()) return "Missed: " + depth + ".";
  return "Missed" + aside + (depth.empty() ? "." : ", " + depth + ".");
}

std::string missDirectionText(const Miss& miss) {
  return miss.at == Miss::At::kInjection
             ? "Where the last injection began, at the needle's opening."
             : "At the furthest point of the last insertion, at the needle's tip.";
}

}  // namespace needlelab

#include "common/scoring/targets/miss.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "common/base/text/text.h"
#include "common/scoring/measures/measure_groups.h"

namespace needlelab {
namespace {

/// sin 22.5°: a direction further than 67.5° away is not named.
constexpr double kNamed = 0.3826834323650898;
/// Smaller values read as "0.0 mm".
constexpr double kShown_m = 0.05e-3;

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

Miss missAt(const Anatomy& anatomy, const pb::Directions& directions, const Pose& X_WL,
            const NeedleWay& way) {
  Miss miss;
  miss.through = hazardsOn(anatomy, way);
  miss.in_target = InTarget(anatomy)(way);
  if (miss.in_target) return miss;
  double least_m = std::numeric_limits<double>::infinity();
  for (const Target& target : anatomy.targets) {
    const OffTarget off = offTarget(anatomy, target, way);
    const double away_m = off.aside_m + std::abs(off.too_deep_m);
    if (away_m >= least_m) continue;
    least_m = away_m;
    miss.too_deep_m = off.too_deep_m;
    miss.aside_m = off.aside_m;
    miss.towards = namesOf(directions, rotate(conjugate(normalized(X_WL.q)), off.aside_W));
  }
  return miss;
}

std::optional<Miss> missOf(std::span<const GestureSample> samples, std::span<const pb::SyringeEvent> events,
                           const pb::Profile& profile, const Pose& X_WL) {
  const Anatomy anatomy = anatomyOf(profile, X_WL);
  if (anatomy.targets.empty()) return std::nullopt;
  const RecordedSamples usable(samples);
  const pb::SyringeEvent* injection = nullptr;
  for (const pb::SyringeEvent& event : events)
    if (event.kind() == pb::SyringeEvent::INJECTION && event.begin().in_tissue()) injection = &event;
  FinalPoint furthest;
  std::optional<std::size_t> at;  // a thinned recording may not have the very tick
  for (std::size_t i = 0; i < usable.size(); ++i) {
    furthest.add(usable[i], i);
    if (injection != nullptr && isInside(usable[i]) && usable[i].tick <= injection->begin_tick()) at = i;
  }
  if (!at && !furthest.index) return std::nullopt;
  NeedleWay way = wayOf(usable[at ? *at : *furthest.index]);
  if (at) {
    const pb::SyringePlace& opening = injection->begin();
    way.length_m = dot(Vec3{opening.x_m(), opening.y_m(), opening.z_m()} - way.skin_W_m, way.axis_W);
  }
  Miss miss = missAt(anatomy, profile.directions(), X_WL, way);
  if (at) miss.at = Miss::At::kInjection;
  return miss;
}

std::string missText(const Miss& miss) {
  std::string through;
  for (const std::string& name : miss.through)
    through += (through.empty() ? "Through the " : " and the ") + name;
  if (miss.in_target) return through.empty() ? "In the target." : through + ", in the target.";
  std::string aside, depth;
  if (miss.aside_m >= kShown_m) {
    aside = "issed by " + mm(miss.aside_m);
    const char* before = " ";
    for (const std::string& name : miss.towards) {
      aside += before + name;
      before = " and ";
    }
    if (miss.towards.empty()) aside += " to the side";
  }
  if (std::abs(miss.too_deep_m) >= kShown_m)
    depth = mm(std::abs(miss.too_deep_m)) + (miss.too_deep_m > 0 ? " too deep" : " too shallow");
  if (aside.empty() && depth.empty()) aside = "issed by less than 0.1 mm";
  const bool both = !aside.empty() && !depth.empty();
  if (through.empty()) return (aside.empty() ? "Missed: " : "M" + aside) + (both ? ", " : "") + depth + ".";
  return through + (aside.empty() ? ", " : ": m" + aside) + (both ? ", " : "") + depth + ".";
}

std::string missDirectionText(const Miss& miss) {
  return miss.at == Miss::At::kInjection
             ? "Where the last injection began, at the needle's opening."
             : "At the furthest point of the last insertion, at the needle's tip.";
}

}  // namespace needlelab

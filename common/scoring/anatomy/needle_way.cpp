#include "common/scoring/anatomy/needle_way.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/haptics/body.h"

namespace needlelab {
namespace {

/// What is thinner may be stepped over.
constexpr double kWayStep_m = 1e-4;
constexpr double kExact_m = 1e-9;
/// How far a needle could go on behind its point.
constexpr double kGoesOn_m = 0.2;
/// A target lies within this of a needle's line: farther than any body is wide.
constexpr double kFarAside_m = 2;
/// Places of a line that are equally near to a target differ by less.
constexpr double kEquallyNear_m = 1e-6;
constexpr double kAskAgain_m = 50e-6;

/// The first place from `from_m` to `to_m` at which a distance is at most 0 (or above 0, with `sign` −1).
template <typename Distance>
std::optional<double> firstIn(const Distance& distance, double from_m, double to_m, double sign = 1) {
  const auto isThere = [&](double away_m) { return sign > 0 ? away_m <= 0 : away_m < 0; };
  double before_m = from_m, s = from_m, away_m = sign * distance(s);
  while (!isThere(away_m)) {
    if (s >= to_m) return std::nullopt;
    before_m = s;
    s = std::min(to_m, s + std::max(away_m / kMostSteep, kWayStep_m));
    away_m = sign * distance(s);
  }
  while (s - before_m > kExact_m) {
    const double middle_m = 0.5 * (before_m + s);
    (isThere(sign * distance(middle_m)) ? s : before_m) = middle_m;
  }
  return s;
}

auto fromTarget(const Anatomy& anatomy, const Target& target, const NeedleWay& way) {
  return [&anatomy, &target, &way](double s) { return distanceTo(anatomy, target, way.at(s)); };
}

/// The first place from `from_m` on that lies in a hazard and not in the target; infinity: none up to `to_m`.
double firstHazard(const Anatomy& anatomy, const Target& target, const NeedleWay& way, double from_m,
                   double to_m) {
  double first_m = std::numeric_limits<double>::infinity();
  for (const Region& hazard : anatomy.hazards) {
    const auto outside = [&](double s) {
      return -std::max(distanceTo(hazard, way.at(s)), -distanceTo(anatomy, target, way.at(s)));
    };
    if (const auto found = firstIn(outside, from_m, std::min(to_m, first_m), -1)) first_m = *found;
  }
  return first_m;
}

bool touches(const Region& hazard, const NeedleWay& way) {
  return way.length_m > 0 && distanceTo(hazard, way.end(), way.skin_W_m) <= 0;
}

/// Whether a hazard lies between the target's near side and the way's end, which is in the target's region.
bool isBehindHazard(const Anatomy& anatomy, const Target& target, const NeedleWay& way) {
  const bool any = std::ranges::any_of(anatomy.hazards, [&](const Region& h) { return touches(h, way); });
  if (!any) return false;
  const auto near_m = firstIn(fromTarget(anatomy, target, way), 0, way.length_m);
  return near_m && std::isfinite(firstHazard(anatomy, target, way, *near_m, way.length_m));
}

/// Across the line: the way from it to a target that it misses.
class Across {
 public:
  Across(const Anatomy& anatomy, const Target& target, const NeedleWay& way)
      : anatomy_(anatomy), target_(target), way_(way) {
    const Vec3 a = way.axis_W;
    first_ = normalized(cross(a, std::abs(a.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
    second_ = cross(a, first_);
  }

  [[nodiscard]] OffTarget nearest(double to_m) {
    constexpr double kTurn = 6.283185307179586 / 48, kAlong_m = 1e-3;
    for (double s = 0; s <= to_m;) {
      const double away_m = from(way_.at(s)) / kMostSteep;
      if (away_m < least_m_ + kEquallyNear_m)
        for (int k = 0; k < 48; ++k) look(s, k * kTurn, kEquallyNear_m);
      s += std::max(kAlong_m, away_m - least_m_);
    }
    for (double share = 0.5; share > 1e-5 && std::isfinite(least_m_); share *= 0.7) {
      const double s = at_m_, angle = angle_;
      for (const double along : {-1, 0, 1})
        for (const double turn : {-1, 0, 1})
          look(s + share * along * kAlong_m, angle + share * turn * kTurn, 0);
    }
    return {way_.length_m - at_m_, least_m_, -1 * direction(angle_)};
  }

 private:
  [[nodiscard]] Vec3 direction(double angle) const {
    return std::cos(angle) * first_ + std::sin(angle) * second_;
  }
  [[nodiscard]] double from(Vec3 p_W_m) const { return distanceTo(anatomy_, target_, p_W_m); }

  // `ties_m`: of ways that differ by less, the one nearer to the needle's end counts
  void look(double at_m, double angle, double ties_m) {
    const Vec3 line = way_.at(at_m), out = direction(angle);
    const auto found =
        firstIn([&](double r) { return from(line + r * out); }, 0, std::min(kFarAside_m, least_m_ + ties_m));
    if (!found) return;
    const bool nearer_end = std::abs(at_m - way_.length_m) < std::abs(at_m_ - way_.length_m);
    if (*found >= least_m_ - ties_m && !(ties_m > 0 && nearer_end)) return;
    least_m_ = std::min(least_m_, *found);
    at_m_ = at_m;
    angle_ = angle;
  }

  const Anatomy& anatomy_;
  const Target& target_;
  const NeedleWay& way_;
  Vec3 first_, second_;  // across the axis, unit
  double least_m_ = std::numeric_limits<double>::infinity(), at_m_ = 0, angle_ = 0;
};

}  // namespace

NeedleWay wayOf(const GestureSample& sample, double behind_tip_m) {
  const Vec3 axis = zAxis(normalized(Quat{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}));
  const Vec3 tip{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]};
  return {tip - sample.insertion_m * axis, axis, sample.insertion_m - behind_tip_m};
}

std::vector<std::string> hazardsOn(const Anatomy& anatomy, const NeedleWay& way) {
  std::vector<std::string> names;
  for (const Region& hazard : anatomy.hazards)
    if (touches(hazard, way)) names.push_back(hazard.name);
  return names;
}

OffTarget offTarget(const Anatomy& anatomy, const Target& target, const NeedleWay& way) {
  const auto distance = fromTarget(anatomy, target, way);
  const double to_m = std::max(0.0, way.length_m) + kGoesOn_m;
  const auto near_m = firstIn(distance, 0, to_m);
  if (!near_m) return Across(anatomy, target, way).nearest(to_m);
  const double hazard_m = firstHazard(anatomy, target, way, *near_m, to_m);
  OffTarget off{std::numeric_limits<double>::infinity(), 0, {}};
  for (auto in_m = near_m; in_m && *in_m <= hazard_m;) {
    const double out_m = std::min(firstIn(distance, *in_m, to_m, -1).value_or(to_m), hazard_m);
    const double beyond_m = way.length_m > out_m ? way.length_m - out_m : std::min(0.0, way.length_m - *in_m);
    if (std::abs(beyond_m) < std::abs(off.too_deep_m)) off.too_deep_m = beyond_m;
    if (out_m >= std::min(hazard_m, to_m)) break;
    in_m = firstIn(distance, out_m, to_m);
  }
  return off;
}

double distanceOn(const Anatomy& anatomy, const Target& target, const NeedleWay& way) {
  const double from_m = distanceTo(anatomy, target, way.end());
  return from_m <= 0 && isBehindHazard(anatomy, target, way) ? offTarget(anatomy, target, way).too_deep_m
                                                             : from_m;
}

bool InTarget::operator()(const NeedleWay& way) {
  for (std::size_t i = 0; i < asked_.size(); ++i) {
    const Target& target = anatomy_->targets[i];
    const Vec3 end = way.end();
    if (distanceTo(*anatomy_, target, end) > 0) continue;
    Asked& asked = asked_[i];
    if (!asked.behind || norm(end - asked.end_W_m) > kAskAgain_m ||
        norm(way.skin_W_m - asked.skin_W_m) > kAskAgain_m)
      asked = {way.skin_W_m, end, isBehindHazard(*anatomy_, target, way)};
    if (!*asked.behind) return true;
  }
  return false;
}

}  // namespace needlelab

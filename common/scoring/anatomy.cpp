
#include "common/scoring/anatomy.h"

#include <algorithm>

namespace needlelab {
namespace {

Vec3 vectorOf(const pb::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

Anatomy anatomyOf(const pb::Profile& profile, const Pose& X_WL) {
  const Pose X{X_WL.p, normalized(X_WL.q)};
  Anatomy anatomy;
  anatomy.has_limb = true;
  switch (profile.limb().shape_case()) {
    case pb::Limb::kPlane: {
      const auto& plane = profile.limb().plane();
      anatomy.limb = PlaneLimb{vectorOf(plane.point_m()), normalized(vectorOf(plane.normal()))};
      break;
    }
    case pb::Limb::kSphere:
      anatomy.limb =
          SphereLimb{vectorOf(profile.limb().sphere().center_m()), profile.limb().sphere().radius_m()};
      break;
    case pb::Limb::kCapsule: {
      const auto& capsule = profile.limb().capsule();
      anatomy.limb = CapsuleLimb{vectorOf(capsule.a_m()), vectorOf(capsule.b_m()), capsule.radius_m()};
      break;
    }
    case pb::Limb::SHAPE_NOT_SET:
      anatomy.has_limb = false;
      break;
  }
  anatomy.limb = placed(anatomy.limb, X);
  for (const auto& target : profile.targets()) {
    const Vec3 center = X * vectorOf(target.center_m());
    anatomy.targets.push_back({target.name(), center, center, target.radius_m()});
  }
  for (const auto& hazard : profile.hazards()) {
    const bool is_ball = hazard.has_center_m();
    const Vec3 a = X * vectorOf(is_ball ? hazard.center_m() : hazard.a_m());
    const Vec3 b = is_ball ? a : X * vectorOf(hazard.b_m());
    anatomy.hazards.push_back({hazard.name(), a, b, hazard.radius_m()});
  }
  return anatomy;
}

double segmentDistance(Vec3 p, Vec3 q, Vec3 a, Vec3 b) {
  const auto share = [](double numerator, double denominator) {
    return denominator > 0 ? std::clamp(numerator / denominator, 0.0, 1.0) : 0.0;
  };
  const Vec3 d = q - p, e = b - a, r = p - a;
  const double dd = dot(d, d), ee = dot(e, e), de = dot(d, e), dr = dot(d, r), er = dot(e, r);
  // nearest point of the first line to the second, clamped to its segment; then back and forth once, clamped
  // each time
  double s = share(de * er - ee * dr, dd * ee - de * de);
  const double t = share(er + s * de, ee);
  s = share(t * de - dr, dd);
  return norm(r + s * d - t * e);
}

double distanceTo(const Region& region, Vec3 p_W_m) {
  return segmentDistance(p_W_m, p_W_m, region.a_W_m, region.b_W_m) - region.radius_m;
}

double distanceTo(const Region& region, Vec3 tip_W_m, Vec3 skin_W_m) {
  return segmentDistance(tip_W_m, skin_W_m, region.a_W_m, region.b_W_m) - region.radius_m;
}

}  // namespace needlelab

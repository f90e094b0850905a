#include "common/haptics/surface.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

double depthIn(const PlaneLimb& plane, Vec3 p) {
  return -dot(plane.normal, p - plane.point_m);
}
double depthIn(const SphereLimb& sphere, Vec3 p) {
  return sphere.radius_m - norm(p - sphere.center_m);
}
double depthIn(const CapsuleLimb& capsule, Vec3 p) {
  const Vec3 ab = capsule.b_m - capsule.a_m;
  const double t = std::clamp(dot(p - capsule.a_m, ab) / normSquared(ab), 0.0, 1.0);
  return capsule.radius_m - norm(p - (capsule.a_m + ab * t));
}
double depthIn(const BodyLimb& limb, Vec3 p) {
  return limb.body->depth(inverse(limb.X_WL) * p);
}

/// The ways from a point in a body to the skin, and the least of them.
class WaysOut {
 public:
  struct Way {
    double length_m;
    Vec3 out;  // unit
  };

  /// `depth_m`: the body's depth of p, so that no way is shorter.
  WaysOut(const Body& body, Vec3 p_m, double depth_m) noexcept : body_(body), p_m_(p_m), depth_m_(depth_m) {}

  /// From `along`, a way to the skin, and 26 directions; the two best ones turn towards the normal where they
  /// leave the body, as the least way is along it.
  [[nodiscard]] Way least(Vec3 along) const noexcept {
    Way best{norm(along), normalized(along)}, second{kFar_m, {}};
    const auto consider = [&](Vec3 out) {
      const Way way{lengthOf(out, second.length_m), out};
      if (way.length_m < best.length_m) {
        second = best;
        best = way;
      } else if (way.length_m < second.length_m) {
        second = way;
      }
    };
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z)
          if (x != 0 || y != 0 || z != 0)
            consider(
                normalized(Vec3{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)}));
    const Way one = shortened(best), other = shortened(second);
    return one.length_m <= other.length_m ? one : other;
  }

 private:
  static constexpr double kFar_m = 10;

  /// By sphere tracing (Hart 1996); `most_m` if the way is not shorter.
  [[nodiscard]] double lengthOf(Vec3 out, double most_m) const noexcept {
    double way_m = depth_m_;
    for (int step = 0; step < 60 && way_m < most_m; ++step) {
      const double depth_m = body_.depth(p_m_ + out * way_m);
      way_m += depth_m;
      if (std::fabs(depth_m) < 1e-9) return std::min(way_m, most_m);
    }
    return most_m;
  }

  [[nodiscard]] Way shortened(Way way) const noexcept {
    if (way.length_m == kFar_m) return way;
    double share = 1;
    for (int turn = 0; turn < 12 && share > 0.02; ++turn) {
      const Vec3 normal = body_.normal(p_m_ + way.out * way.length_m);
      const Vec3 turned = normalized(way.out + (normal - way.out) * share);
      const double length_m = lengthOf(turned, way.length_m);
      if (length_m < way.length_m - 1e-7)
        way = {length_m, turned};
      else
        share *= 0.5;
    }
    return way;
  }

  const Body& body_;
  Vec3 p_m_;
  double depth_m_;
};

/// The least way to the skin from a point of W in the body, in the body's frame; `along_W`: one that is
/// known.
WaysOut::Way leastWay(const BodyLimb& limb, Vec3 p_W_m, double depth_m, Vec3 along_W) noexcept {
  const WaysOut ways(*limb.body, inverse(limb.X_WL) * p_W_m, depth_m);
  return ways.least(rotate(conjugate(limb.X_WL.q), along_W));
}

}  // namespace

Limb placed(const Limb& limb, const Pose& X_WL) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    return PlaneLimb{X_WL * plane->point_m, rotate(X_WL.q, plane->normal)};
  }
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    return SphereLimb{X_WL * sphere->center_m, sphere->radius_m};
  }
  if (const auto* body = std::get_if<BodyLimb>(&limb)) return BodyLimb{body->body, X_WL * body->X_WL};
  const auto& capsule = std::get<CapsuleLimb>(limb);
  return CapsuleLimb{X_WL * capsule.a_m, X_WL * capsule.b_m, capsule.radius_m};
}

double depthInLimb(const SceneModel& model, const Vec3& p_W_m) noexcept {
  return signedDepth(model.limb, p_W_m);
}

double signedDepth(const Limb& limb, Vec3 p_W_m) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return depthIn(*plane, p_W_m);
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) return depthIn(*sphere, p_W_m);
  if (const auto* body = std::get_if<BodyLimb>(&limb)) return depthIn(*body, p_W_m);
  return depthIn(*std::get_if<CapsuleLimb>(&limb), p_W_m);
}

Vec3 surfaceNormal(const Limb& limb, Vec3 p, Vec3 motion) noexcept {
  Vec3 out;
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) {
    return plane->normal;
  } else if (const auto* sphere = std::get_if<SphereLimb>(&limb)) {
    out = p - sphere->center_m;
  } else if (const auto* body = std::get_if<BodyLimb>(&limb)) {
    out = rotate(body->X_WL.q, body->body->normal(inverse(body->X_WL) * p));
  } else {
    const auto& capsule = *std::get_if<CapsuleLimb>(&limb);
    const Vec3 ab = capsule.b_m - capsule.a_m;
    const double t = std::clamp(dot(p - capsule.a_m, ab) / normSquared(ab), 0.0, 1.0);
    out = p - (capsule.a_m + ab * t);
  }
  const double size = norm(out);
  return size > 1e-12 ? out / size : -normalized(motion);
}

Vec3 nearestSkin(const Limb& limb, Vec3 p, Vec3 motion) noexcept {
  constexpr int kSteps = 8;
  constexpr double kOnSkin_m = 1e-9;
  Vec3 at = p + surfaceNormal(limb, p, motion) * signedDepth(limb, p);
  if (!std::holds_alternative<BodyLimb>(limb)) return at;
  for (int step = 0; step < kSteps; ++step) {
    const double depth_m = signedDepth(limb, at);
    if (!(depth_m > kOnSkin_m || depth_m < -kOnSkin_m)) break;
    at = at + surfaceNormal(limb, at, motion) * depth_m;
  }
  return at;
}

double depthBelowSkin(const Limb& limb, Vec3 p) noexcept {
  const double depth_m = signedDepth(limb, p);
  const auto* const body = std::get_if<BodyLimb>(&limb);
  if (body == nullptr || !(depth_m > 0)) return depth_m;
  return leastWay(*body, p, depth_m, nearestSkin(limb, p, {0, 0, -1}) - p).length_m;
}

Vec3 closestSkin(const Limb& limb, Vec3 p, Vec3 motion) noexcept {
  constexpr double kAsNear_m = 2e-4;  // twice the error of the least way
  const Vec3 near = nearestSkin(limb, p, motion);
  const double depth_m = signedDepth(limb, p);
  const auto* const body = std::get_if<BodyLimb>(&limb);
  if (body == nullptr || !(depth_m > 0)) return near;
  const WaysOut::Way way = leastWay(*body, p, depth_m, near - p);
  return norm(near - p) <= way.length_m + kAsNear_m ? near : p + rotate(body->X_WL.q, way.out) * way.length_m;
}

Vec3 entryPoint(const SimState& before, Vec3 p_W_m, double depth_m) noexcept {
  assert(!(before.depth_prev_m > 0.0) && depth_m > 0.0);
  const double share = before.depth_prev_m / (before.depth_prev_m - depth_m);
  return before.p_prev_W_m + (p_W_m - before.p_prev_W_m) * share;
}

}  // namespace needlelab

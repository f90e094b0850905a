#include "client/device/falcon/falcon_kinematics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/det_math.h"

namespace needlelab::falcon {
namespace {

constexpr double kAxisRadius_m = kBaseRadius_m - kPlatformRadius_m;
constexpr double kLongestShin_m = kShortLinks_m + kShin_m;
/// The device cannot bend a parallelogram to the side by more than this share of its length.
constexpr double kMaxAside = 0.95;
/// Below this spread torques fade, so that they stay bounded where the legs cannot bear a force.
constexpr double kMinSpread = 0.08;
constexpr int kNewtonSteps = 12;
constexpr double kNewtonDone_m = 1e-13, kLongestStep_m = 0.03;

struct Axes {
  Vec3 u, v;
};

// initialised before main, so that no call checks for it
const std::array<Axes, 3> kAxes = [] {
  std::array<Axes, 3> all;
  for (std::size_t i = 0; i < 3; ++i) {
    const double c = detCos(kLegAngle_rad[i]), s = detSin(kLegAngle_rad[i]);
    all[i] = {{c, s, 0}, {-s, c, 0}};
  }
  return all;
}();
constexpr Vec3 kW = {0, 0, 1};

bool finite(const LegAngles& theta) noexcept {
  return std::isfinite(theta[0]) && std::isfinite(theta[1]) && std::isfinite(theta[2]);
}

double clampedAngle(double theta, std::uint8_t& flags) noexcept {
  if (theta >= kThetaMin_rad && theta <= kThetaMax_rad) return theta;
  flags |= kBeyondStop;
  return std::clamp(theta, kThetaMin_rad, kThetaMax_rad);
}

// one leg at a place: the shin in the leg's axes, and the residual of its equation
struct Shin {
  double u, v, w;   // from the knee, v along the parallelogram's side
  double reach;     // √(b² − v²)
  double length;    // d + e + reach: the shin's length in the leg's plane
  double off_half;  // half of the residual of the leg's equation, m²
  bool too_far_aside;
};

Shin shinOf(std::size_t leg, Vec3 p, double cos_theta, double sin_theta) noexcept {
  const Axes& axes = kAxes[leg];
  Shin s{};
  s.u = dot(p, axes.u) - kAxisRadius_m - kThigh_m * cos_theta;
  s.v = dot(p, axes.v) - kFootAside_m;
  s.w = p.z - kThigh_m * sin_theta;
  constexpr double kMost = kMaxAside * kShin_m;
  s.too_far_aside = std::fabs(s.v) > kMost;
  s.v = std::clamp(s.v, -kMost, kMost);
  s.reach = std::sqrt(kShin_m * kShin_m - s.v * s.v);
  s.length = kShortLinks_m + s.reach;
  s.off_half = 0.5 * (s.u * s.u + s.w * s.w - s.length * s.length);
  return s;
}

Vec3 gradientOf(std::size_t leg, const Shin& s) noexcept {
  const Axes& axes = kAxes[leg];
  const double aside = s.too_far_aside ? 0.0 : s.length * s.v / s.reach;
  return s.u * axes.u + aside * axes.v + s.w * kW;
}

// intersection of the spheres around three knees, in front of them
Vec3 spheresMeet(const std::array<Vec3, 3>& knee, double radius) noexcept {
  // points equidistant from all three lie on a line through the circle's centre, perpendicular to its plane
  const Vec3 a = knee[1] - knee[0], b = knee[2] - knee[0];
  const Vec3 normal = cross(a, b);
  const double n2 = normSquared(normal);
  const Vec3 to_middle = (normSquared(a) * cross(b, normal) + normSquared(b) * cross(normal, a)) / (2 * n2);
  // legs pulled fully apart do not meet: use the middle between them
  const double height2 = std::max(0.0, radius * radius - normSquared(to_middle));
  const double height = std::sqrt(height2 / n2);
  return knee[0] + to_middle + (normal.z > 0 ? height : -height) * normal;
}

}  // namespace

double thetaOfCounts(std::int32_t counts) noexcept {
  return kThetaAtZero_rad + counts / kCountsPerRad;
}

std::int16_t countsOfTheta(double theta_rad) noexcept {
  if (!std::isfinite(theta_rad)) return 0;
  const double counts = std::floor((theta_rad - kThetaAtZero_rad) * kCountsPerRad + 0.5);
  return static_cast<std::int16_t>(std::clamp(counts, -32768.0, 32767.0));
}

LegAngles anglesOfEncoders(const std::array<std::int16_t, 3>& encoder) noexcept {
  return {thetaOfCounts(encoder[0]), thetaOfCounts(encoder[1]), thetaOfCounts(encoder[2])};
}

Place forwardKinematics(const LegAngles& theta_rad) noexcept {
  Place place;
  if (!finite(theta_rad)) return {kOrigin_F_m, kInputNotFinite};

  std::array<double, 3> cosine, sine;
  std::array<Vec3, 3> knee;
  for (std::size_t i = 0; i < 3; ++i) {
    const double theta = clampedAngle(theta_rad[i], place.flags);
    cosine[i] = detCos(theta);
    sine[i] = detSin(theta);
    const Axes& axes = kAxes[i];
    knee[i] =
        (kAxisRadius_m + kThigh_m * cosine[i]) * axes.u + kFootAside_m * axes.v + kThigh_m * sine[i] * kW;
  }
  const Vec3 meeting = spheresMeet(knee, kLongestShin_m);
  Vec3 p = meeting;

  // Newton: N dp = −off, rows of N the legs' gradients
  bool found = false, aside = false;
  double spread = 0;
  for (int step = 0; step < kNewtonSteps && !found; ++step) {
    std::array<Vec3, 3> n;
    std::array<double, 3> off;
    aside = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const Shin s = shinOf(i, p, cosine[i], sine[i]);
      n[i] = gradientOf(i, s);
      off[i] = s.off_half;
      aside = aside || s.too_far_aside;
    }
    const Vec3 c0 = cross(n[1], n[2]), c1 = cross(n[2], n[0]), c2 = cross(n[0], n[1]);
    const double det = dot(n[0], c0);
    const double scale = norm(n[0]) * norm(n[1]) * norm(n[2]);
    spread = -det / scale;
    if (!(std::fabs(spread) > 1e-6)) break;
    Vec3 dp = -(off[0] * c0 + off[1] * c1 + off[2] * c2) / det;
    const double length = norm(dp);
    if (length > kLongestStep_m) dp = dp * (kLongestStep_m / length);
    p += dp;
    found = length <= kNewtonDone_m;
  }
  // legs pulled apart or past a singularity: the device cannot reach this position
  if (!found || aside || spread < 0 || !isFinite(p)) {
    place.flags |= kOutOfReach;
    p = meeting;
  } else if (spread < kMinSpread) {
    place.flags |= kNearSingular;
  }
  place.p_F_m = p;
  return place;
}

Legs inverseKinematics(Vec3 p_F_m) noexcept {
  Legs legs;
  if (!isFinite(p_F_m) || normSquared(p_F_m) > 100) {
    legs.theta_rad.fill(kThetaAtZero_rad);
    legs.flags = isFinite(p_F_m) ? kOutOfReach : kInputNotFinite;
    return legs;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    // the knee is on a circle around the thigh's axis and at the shin's length from the grip
    const Shin s = shinOf(i, p_F_m, 0, 0);
    if (s.too_far_aside) legs.flags |= kOutOfReach;
    const double far2 = s.u * s.u + s.w * s.w;
    const double far = std::sqrt(far2);
    double cosine = far > 0 ? (far2 + kThigh_m * kThigh_m - s.length * s.length) / (2 * kThigh_m * far) : 1.0;
    if (!(cosine >= -1 && cosine <= 1)) {
      legs.flags |= kOutOfReach;
      cosine = std::clamp(cosine, -1.0, 1.0);
    }
    const double between = detAtan2(std::sqrt(1 - cosine * cosine), cosine);
    legs.theta_rad[i] = clampedAngle(detAtan2(s.w, s.u) - between, legs.flags);
  }
  if (legJacobian(p_F_m, legs.theta_rad).spread() < kMinSpread) legs.flags |= kNearSingular;
  return legs;
}

LegJacobian legJacobian(Vec3 p_F_m, const LegAngles& theta_rad) noexcept {
  LegJacobian legs;
  for (std::size_t i = 0; i < 3; ++i) {
    const double c = detCos(theta_rad[i]), s = detSin(theta_rad[i]);
    const Shin shin = shinOf(i, p_F_m, c, s);
    legs.n[i] = gradientOf(i, shin);
    legs.m[i] = kThigh_m * (shin.w * c - shin.u * s);
  }
  return legs;
}

double LegJacobian::spread() const noexcept {
  const double scale = norm(n[0]) * norm(n[1]) * norm(n[2]);
  return scale > 0 ? dot(n[0], cross(n[2], n[1])) / scale : 0.0;
}

std::array<Vec3, 3> placePerAngle(const LegJacobian& legs) noexcept {
  const auto& n = legs.n;
  const Vec3 c0 = cross(n[1], n[2]), c1 = cross(n[2], n[0]), c2 = cross(n[0], n[1]);
  const double det = dot(n[0], c0);
  return {c0 * (legs.m[0] / det), c1 * (legs.m[1] / det), c2 * (legs.m[2] / det)};
}

Torques torquesForForce(const LegJacobian& legs, Vec3 f_F_N) noexcept {
  Torques torques;
  const auto& n = legs.n;
  const Vec3 c0 = cross(n[1], n[2]), c1 = cross(n[2], n[0]), c2 = cross(n[0], n[1]);
  const double scale = norm(n[0]) * norm(n[1]) * norm(n[2]);
  const double det = dot(n[0], c0);
  if (!isFinite(f_F_N) || !std::isfinite(det) || !(scale > 0)) {
    torques.flags = kInputNotFinite;
    return torques;
  }
  // the force as a sum of pushes along the shins: Σ x_i n_i = f. Near a singular position, det/least²
  // replaces 1/det: it joins continuously and goes to zero with det
  const double least = kMinSpread * scale;
  double inverse = 0;
  if (std::fabs(det) >= least) {
    inverse = 1 / det;
  } else {
    inverse = det / (least * least);
    torques.flags |= kNearSingular;
  }
  torques.thigh_Nm = {legs.m[0] * dot(f_F_N, c0) * inverse, legs.m[1] * dot(f_F_N, c1) * inverse,
                      legs.m[2] * dot(f_F_N, c2) * inverse};
  return torques;
}

MotorUnits motorUnits(const Torques& torques) noexcept {
  MotorUnits units;
  units.flags = torques.flags;
  constexpr double kUnitsPerNm = kMotorSign / (kGearRatio * kMotorNm_per_unit);
  double greatest = 0;
  for (const double torque : torques.thigh_Nm) {
    if (!std::isfinite(torque)) {
      units.flags |= kInputNotFinite;
      return units;
    }
    greatest = std::max(greatest, std::fabs(torque * kUnitsPerNm));
  }
  double scale = 1;
  if (greatest > kMotorMax) {
    scale = kMotorMax / greatest;
    units.flags |= kTorqueLimited;
  }
  for (std::size_t i = 0; i < 3; ++i)
    units.value[i] = static_cast<std::int16_t>(std::floor(torques.thigh_Nm[i] * kUnitsPerNm * scale + 0.5));
  return units;
}

}  // namespace needlelab::falcon

/// Vectors, unit quaternions and poses: plain structs and free functions. SI, right-handed.
#pragma once

#include <cmath>

namespace needlelab {

struct Vec3 {
  double x = 0, y = 0, z = 0;
  friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
};

constexpr Vec3 operator+(Vec3 a, Vec3 b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
constexpr Vec3 operator-(Vec3 a, Vec3 b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
constexpr Vec3 operator-(Vec3 a) {
  return {-a.x, -a.y, -a.z};
}
constexpr Vec3 operator*(Vec3 a, double s) {
  return {a.x * s, a.y * s, a.z * s};
}
constexpr Vec3 operator*(double s, Vec3 a) {
  return a * s;
}
constexpr Vec3 operator/(Vec3 a, double s) {
  return {a.x / s, a.y / s, a.z / s};
}
constexpr Vec3& operator+=(Vec3& a, Vec3 b) {
  return a = a + b;
}
constexpr double dot(Vec3 a, Vec3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
constexpr Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
constexpr double normSquared(Vec3 a) {
  return dot(a, a);
}
inline double norm(Vec3 a) {
  return std::sqrt(dot(a, a));
}
/// Unit vector along `a`; `a` must not be zero.
inline Vec3 normalized(Vec3 a) {
  return a / norm(a);
}
inline bool isFinite(Vec3 a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
/// For assertions: whether the length is 1 but for rounding. Accepts what a recorded pose that is not a
/// rotation can make of a direction: zero, infinite or NaN.
inline bool isUnit(Vec3 a) {
  const double squared = normSquared(a);
  return !(squared > 0.0 && std::isfinite(squared)) || std::fabs(squared - 1.0) <= 1e-8;
}

/// Rotation as a unit quaternion, order x y z w.
struct Quat {
  double x = 0, y = 0, z = 0, w = 1;
  friend constexpr bool operator==(const Quat&, const Quat&) = default;
};

constexpr double dot(Quat a, Quat b) {
  return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}
inline bool isFinite(Quat q) {
  return std::isfinite(q.x) && std::isfinite(q.y) && std::isfinite(q.z) && std::isfinite(q.w);
}
inline Quat normalized(Quat q) {
  const double n = std::sqrt(dot(q, q));
  return {q.x / n, q.y / n, q.z / n, q.w / n};
}
constexpr Quat conjugate(Quat q) {
  return {-q.x, -q.y, -q.z, q.w};
}
/// Hamilton product: rotates by `b` first, then by `a`.
constexpr Quat operator*(Quat a, Quat b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
constexpr Vec3 rotate(Quat q, Vec3 v) {
  const Vec3 r{q.x, q.y, q.z};
  const Vec3 t = 2.0 * cross(r, v);
  return v + q.w * t + cross(r, t);
}
/// The z axis of the rotated frame: for a tip frame T (+z from hub to tip) the needle's axis in W.
constexpr Vec3 zAxis(Quat q) {
  return {2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x * q.x + q.y * q.y)};
}

/// The pose of frame B in frame A: B's origin `p` in A, and the rotation from B's axes to A's.
struct Pose {
  Vec3 p;
  Quat q;
  friend constexpr bool operator==(const Pose&, const Pose&) = default;
};

/// X_AC from X_AB and X_BC.
constexpr Pose operator*(const Pose& a, const Pose& b) {
  return {a.p + rotate(a.q, b.p), a.q * b.q};
}
constexpr Vec3 operator*(const Pose& a, Vec3 p) {
  return a.p + rotate(a.q, p);
}
constexpr Pose inverse(const Pose& a) {
  return {-rotate(conjugate(a.q), a.p), conjugate(a.q)};
}

/// Force and torque; the point of the torque and the frame are in the variable's name.
struct Wrench {
  Vec3 force_N;
  Vec3 torque_Nm;
  friend constexpr bool operator==(const Wrench&, const Wrench&) = default;
};

// The syringe mock on the device's handle (FORCE_MODEL.md, "Device limits").

/// Tip pose X_WT from the handle's pose X_WH and the tool X_HT (the tip in the handle's frame).
constexpr Pose tipFromHandle(const Pose& X_WH, const Pose& X_HT) {
  return X_WH * X_HT;
}

/// The same wrench about the handle: τ_handle = τ + (p_tip − p_handle) × f. All in W.
constexpr Wrench wrenchAtHandle(const Wrench& at_tip, Vec3 p_WT_m, Vec3 p_WH_m) {
  return {at_tip.force_N, at_tip.torque_Nm + cross(p_WT_m - p_WH_m, at_tip.force_N)};
}

}  // namespace needlelab

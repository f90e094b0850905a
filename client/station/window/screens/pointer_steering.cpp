#include "client/station/window/screens/pointer_steering.h"

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

constexpr double kLongestFrame_s = 0.1;
constexpr double kNearly = 1e-6;

// normalized component of `v` orthogonal to the unit vector `axis`; `other` if that is nearly zero
Vec3 across(Vec3 v, Vec3 axis, Vec3 other) {
  const Vec3 part = v - axis * dot(v, axis);
  return norm(part) > 0.1 ? normalized(part) : other;
}

// rotation by `angle` about the unit vector `axis`, applied after `q`
Quat turned(Quat q, Vec3 axis, double angle) {
  const double s = std::sin(angle / 2);
  return normalized(Quat{axis.x * s, axis.y * s, axis.z * s, std::cos(angle / 2)} * q);
}

}  // namespace

DirectionsAcross directionsAcross(Vec3 axis_W, const SteerView& view) {
  const Vec3 toward = cross(view.right_W, view.up_W);
  const Vec3 right = across(view.right_W, axis_W, across(view.up_W, axis_W, {1, 0, 0}));
  const Vec3 away = cross(axis_W, right);
  return {right, dot(away, view.up_W - toward) < 0 ? -away : away};
}

const SteeringTarget& PointerSteering::update(const SteerInput& input, const SteerView& view, Vec3 tip_W_m) {
  const double dt = std::clamp(input.dt_s, 0.0, kLongestFrame_s);
  const double share = input.fine ? kFineShare : 1;
  const Vec3 axis = zAxis(target_.X_WT.q);
  const auto [right, away] = directionsAcross(axis, view);
  if (input.moves()) lines_up_at_.reset();
  if (lines_up_at_) target_.X_WT = *lines_up_at_;

  const double along_m = share * (input.advance * kAdvance_mps * dt + input.wheel * kWheel_m);
  const double right_m =
      share * (input.across_right * kAcross_mps * dt + input.across_right_px * kAcross_m_per_px);
  const double away_m = share * (input.across_up * kAcross_mps * dt + input.across_up_px * kAcross_m_per_px);
  target_.X_WT.p += axis * along_m + right * right_m + away * away_m;

  const double tilt_right =
      share * (input.tilt_right * kTilt_radps * dt + input.tilt_right_px * kTilt_rad_per_px);
  const double tilt_up = share * (input.tilt_up * kTilt_radps * dt + input.tilt_up_px * kTilt_rad_per_px);
  // the hub is at −axis from the tip: to move it to `right`, rotate about −axis × right
  if (std::abs(tilt_right) > kNearly)
    target_.X_WT.q = turned(target_.X_WT.q, cross(-axis, right), tilt_right);
  if (std::abs(tilt_up) > kNearly) target_.X_WT.q = turned(target_.X_WT.q, cross(-axis, away), tilt_up);

  const double plunger = (input.press ? 1 : 0) - (input.draw ? 1 : 0);
  target_.plunger = std::clamp(target_.plunger + plunger * kPress_per_s * dt, 0.0, 1.0);

  const Vec3 ahead = target_.X_WT.p - tip_W_m;
  if (const double far = norm(ahead); far > kLeash_m) target_.X_WT.p = tip_W_m + ahead * (kLeash_m / far);
  return target_;
}

}  // namespace needlelab

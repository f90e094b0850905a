#include "client/device/pivot_device.h"

#include <cmath>
#include <numbers>

#include "client/device/encoder_step.h"

namespace needlelab {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

}  // namespace

PivotDevice::PivotDevice(const PivotMotion& motion) : motion_(motion) {
  info_.name = "simulated hand that swings the handle about a dimple";
  info_.renders_force = false;
  info_.renders_torque = false;
}

Status PivotDevice::open(double rate_hz) {
  rate_hz_ = rate_hz;
  tick_ = 0;
  random_ = motion_.seed;
  return {};
}

Pose PivotDevice::handleAt(double t_s) const noexcept {
  // a swing about a horizontal axis that itself goes round, and a slow turn of the handle about its needle
  const double azimuth = kTwoPi * t_s / motion_.turn_period_s;
  const double half = 0.5 * motion_.swing_rad * std::sin(kTwoPi * t_s / motion_.swing_period_s);
  const double half_turn = 0.25 * std::sin(kTwoPi * t_s / (1.7 * motion_.turn_period_s));
  const Quat swing{std::cos(azimuth) * std::sin(half), std::sin(azimuth) * std::sin(half), 0, std::cos(half)};
  const Quat turn{0, 0, std::sin(half_turn), std::cos(half_turn)};
  const Quat down{1, 0, 0, 0};  // half a turn about x: +z of the handle points down
  Pose X_WH;
  X_WH.q = normalized(swing * down * turn);
  Vec3 tip = motion_.p_WP_m;
  if (motion_.slip_at_s > 0 && t_s >= motion_.slip_at_s) tip.x += motion_.slip_m;
  X_WH.p = tip - rotate(X_WH.q, motion_.X_HT.p);
  return X_WH;
}

// nearly normal: the sum of twelve uniform numbers has variance 1
double PivotDevice::noise() noexcept {
  double sum = -6;
  for (int i = 0; i < 12; ++i) {
    random_ = random_ * 6364136223846793005u + 1442695040888963407u;
    sum += static_cast<double>(random_ >> 11) * 0x1p-53;
  }
  return sum * motion_.noise_m;
}

DeviceRead PivotDevice::read(DeviceReading& reading) noexcept {
  const double t_s = static_cast<double>(tick_) / rate_hz_;
  if (motion_.seconds > 0 && t_s >= motion_.seconds) return DeviceRead::kFinished;
  ++tick_;
  reading = {};
  reading.X_WH = handleAt(t_s);
  Vec3& p = reading.X_WH.p;
  p += {noise(), noise(), noise()};
  const double step = motion_.encoder_step_m;
  p = {toStep(p.x, step), toStep(p.y, step), toStep(p.z, step)};
  return DeviceRead::kFresh;
}

}  // namespace needlelab

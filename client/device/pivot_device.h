/// A handle whose needle tip rests in a dimple while it is swung to all sides: for trying out `--calibrate`,
/// and for its tests.
#pragma once

#include <cstdint>

#include "client/device/device.h"

namespace needlelab {

struct PivotMotion {
  Pose X_HT{{0.012, -0.008, 0.142}, {0, 0, 0, 1}};  ///< what a calibration shall find
  Vec3 p_WP_m{0.45, 0.05, -0.12};                   ///< the dimple
  double swing_rad = 0.45;                          ///< to every side, [0, 1.5]
  double swing_period_s = 2.4;                      ///< to and fro, (0, 60]
  double turn_period_s = 15;  ///< the direction of the swing goes round in this time, (0, 600]
  double noise_m = 30e-6;     ///< standard deviation of each coordinate of the handle, in each tick
  double encoder_step_m = 10e-6;
  std::uint64_t seed = 1;
  double slip_at_s = 0;  ///< from here on the tip lies `slip_m` aside; 0 = it never slips
  double slip_m = 0;
  double seconds = 0;  ///< ends after so long; 0 = it never ends
};

/// Deterministic on one machine. The needle hangs downward in the middle of the swing. Takes no force.
class PivotDevice final : public Device {
 public:
  explicit PivotDevice(const PivotMotion& motion);
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench&) noexcept override {}
  void skip(std::uint64_t ticks) noexcept override { tick_ += ticks; }
  void close() noexcept override {}

  /// The handle at `t_s`, without noise and encoder.
  [[nodiscard]] Pose handleAt(double t_s) const noexcept;

 private:
  double noise() noexcept;
  PivotMotion motion_;
  DeviceInfo info_;
  double rate_hz_ = 0;
  std::uint64_t tick_ = 0;
  std::uint64_t random_ = 0;
};

}  // namespace needlelab

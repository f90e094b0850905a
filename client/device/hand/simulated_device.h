/// Devices without hardware: a Virtuose 6D Desktop held by a simulated hand, for learning, tests and the
/// offline tool; and a handle swinging about a dimple, for trying out `--calibrate`.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "client/device/device.h"
#include "client/device/hand/hand.h"

namespace needlelab {

struct SimulatedDeviceOptions {
  HandOptions hand;
  std::shared_ptr<HandSteering> steering;  ///< steers the hand; null: the hand follows its plan
  Pose X_HT;                               ///< tip in the handle's frame; the hand's plan is for the tip
  DeviceLimits limits;                     ///< includes the handle's apparent mass and damping
  double inertia_kgm2 = 1e-3;              ///< of the handle about every axis
  double rotational_damping_Nms_per_rad = 0.01;
  double dry_friction_N = 0;         ///< Coulomb friction against translation
  double encoder_step_m = 10e-6;     ///< 0 = exact
  double encoder_step_rad = 100e-6;  ///< 0 = exact
  std::uint32_t delay_ticks =
      1;             ///< the wrench of tick k acts from tick k + delay on; at most kMaxDelayTicks
  double lag_s = 0;  ///< first-order lag of the motors, after the delay; [0, 0.1]
  /// Play of the transmission: along every axis, the handle moves freely by this much relative to motors and
  /// encoders before the force reaches it. [0, 0.01] m
  double backlash_m = 0;
  double integration_hz = 20'000;
};

/// Deterministic: same options, plan and wrenches give the same bits on every machine with IEEE doubles.
/// `read` integrates one tick (semi-implicit Euler) under the wrench now due, then reports the encoders; its
/// first call reports the start pose. Returns kFinished at the end of the plan. The handle translates as a
/// point mass and rotates as a ball.
class SimulatedDevice final : public Device {
 public:
  static constexpr std::uint32_t kMaxDelayTicks = 15;

  SimulatedDevice(const SimulatedDeviceOptions& options, HandPlan plan);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Errors: kInvalidInput names the option, its value and range.
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  /// Integrates the missed ticks under the wrenches due; the last one holds.
  std::uint64_t skip(std::uint64_t ticks) noexcept override;
  void close() noexcept override;

  /// Work of force and torque on the handle since `open`, after lag and play. For studies.
  [[nodiscard]] double forceWork_J() const noexcept { return force_work_J_; }
  [[nodiscard]] double torqueWork_J() const noexcept { return torque_work_J_; }
  /// Returns the handle's true state, not the encoders'. For tests and studies.
  [[nodiscard]] const HandleState& handle() const noexcept { return handle_; }
  /// The hand on the handle. Valid only after `open`.
  [[nodiscard]] const Hand& hand() const noexcept { return *hand_; }

 private:
  void advance() noexcept;
  void integrate(const Wrench& wrench) noexcept;
  [[nodiscard]] Vec3 throughPlay(Vec3 force_N) noexcept;
  SimulatedDeviceOptions options_;
  HandPlan plan_;
  DeviceInfo info_;
  std::optional<Hand> hand_;
  HandleState handle_;
  double step_s_ = 0;
  double lag_left_ = 0;  // share of a wrench's step left after one step of integration
  Wrench lagging_;
  Vec3 play_m_;  // how far motors and encoders lie ahead of the handle
  double force_work_J_ = 0, torque_work_J_ = 0;
  std::int64_t steps_per_tick_ = 0;
  std::uint64_t tick_ = 0;  // the next read's tick
  std::array<Wrench, kMaxDelayTicks + 1> pending_;
};

struct PivotMotion {
  Pose X_HT{{0.012, -0.008, 0.142}, {0, 0, 0, 1}};  ///< the expected result of a calibration
  Vec3 p_WP_m{0.45, 0.05, -0.12};                   ///< the dimple
  double swing_rad = 0.45;                          ///< to every side, [0, 1.5]
  double swing_period_s = 2.4;                      ///< to and fro, (0, 60]
  double turn_period_s = 15;                        ///< time of one turn of the swing's direction, (0, 600]
  double noise_m = 30e-6;  ///< standard deviation of each coordinate of the handle, in each tick
  double encoder_step_m = 10e-6;
  std::uint64_t seed = 1;
  double slip_at_s = 0;  ///< from this time on the tip is `slip_m` off; 0 = it never slips
  double slip_m = 0;
  double seconds = 0;  ///< duration; 0 = endless
};

/// Deterministic on one machine. The needle points down in the middle of the swing. Renders no force.
class PivotDevice final : public Device {
 public:
  explicit PivotDevice(const PivotMotion& motion);
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench&) noexcept override {}
  std::uint64_t skip(std::uint64_t ticks) noexcept override;
  void close() noexcept override {}

  /// Returns the handle's pose at `t_s`, without noise and encoder.
  [[nodiscard]] Pose handleAt(double t_s) const noexcept;

 private:
  double noise() noexcept;
  PivotMotion motion_;
  DeviceInfo info_;
  double rate_hz_ = 0;
  std::uint64_t end_tick_ = 0;
  std::uint64_t tick_ = 0;
  std::uint64_t random_ = 0;
};

}  // namespace needlelab

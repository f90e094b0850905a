/// A Virtuose 6D Desktop held by a simulated hand: for learning, tests and the offline tool, without
/// hardware.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "client/device/device.h"
#include "client/device/hand.h"

namespace needlelab {

struct SimulatedDeviceOptions {
  HandOptions hand;
  std::shared_ptr<HandSteering> steering;  ///< the hand is steered; null: it pursues its plan
  Pose X_HT;                   ///< tip in the handle's frame: the hand pursues its plan with the tip
  DeviceLimits limits;         ///< its apparent mass and damping move the handle
  double inertia_kgm2 = 1e-3;  ///< of the handle about every axis
  double rotational_damping_Nms_per_rad = 0.01;
  double dry_friction_N = 0;         ///< Coulomb friction against translation
  double encoder_step_m = 10e-6;     ///< 0 = exact
  double encoder_step_rad = 100e-6;  ///< 0 = exact
  std::uint32_t delay_ticks =
      1;  ///< the wrench of tick k acts from tick k + delay on; at most kMaxDelayTicks
  double integration_hz = 20'000;
};

/// Deterministic: same options, plan and wrenches give the same bits on every machine with IEEE doubles.
/// `read` integrates one tick (semi-implicit Euler) under the wrench that is due, then reports the encoders;
/// its first call reports the start pose. kFinished when the plan is over. Translation is a point mass,
/// rotation a ball.
class SimulatedDevice final : public Device {
 public:
  static constexpr std::uint32_t kMaxDelayTicks = 15;

  SimulatedDevice(const SimulatedDeviceOptions& options, HandPlan plan);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  /// Errors: kInvalidInput names the option, its value and range.
  Status open(double rate_hz) override;
  DeviceRead read(DeviceReading& reading) noexcept override;
  void write(const GuardedWrench& at_handle_W) noexcept override;
  /// Time goes on under the wrenches that are due, the last one holding.
  void skip(std::uint64_t ticks) noexcept override;
  void close() noexcept override;

  /// The handle as it is, not as the encoders say. For tests and studies.
  [[nodiscard]] const HandleState& handle() const noexcept { return handle_; }
  /// Where the hand wants it. Only after `open`.
  [[nodiscard]] const Hand& hand() const noexcept { return *hand_; }

 private:
  void advance() noexcept;
  void integrate(const Wrench& wrench) noexcept;
  SimulatedDeviceOptions options_;
  HandPlan plan_;
  DeviceInfo info_;
  std::optional<Hand> hand_;
  HandleState handle_;
  double step_s_ = 0;
  std::int64_t steps_per_tick_ = 0;
  std::uint64_t tick_ = 0;  // of the next read
  std::array<Wrench, kMaxDelayTicks + 1> pending_;
};

}  // namespace needlelab

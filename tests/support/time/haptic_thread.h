/// The haptic thread in a simulated world: one tick per turn, like ServoLoop, with the real gate and engine.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>

#include "client/device/haptic_chain.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/time/device_world.h"

namespace needlelab::test {

/// Ticks are 1 ms. A tick that is late by a period or more has missed ticks.
class HapticThread final : public Turns {
 public:
  /// All arguments must outlive the thread. The gate takes its rate from `model`.
  HapticThread(TimeSource& time, Device& device, const SceneModel& model)
      : time_(time), device_(device), chain_(model, device.info(), Pose{}) {}

  std::optional<std::int64_t> turn() noexcept override {
    const std::int64_t now_ns = time_.nowNs();
    if (stop_) {
      device_.write(GuardedWrench{});
      return std::nullopt;
    }
    if (now_ns < silent_until_ns_) return silent_until_ns_;
    if (number_ == 0) start_ns_ = now_ns;
    last_tick_ns_ = now_ns;
    const std::int64_t missed = std::max<std::int64_t>(0, (now_ns - dueNs()) / kMs);
    if (missed > 0) device_.skip(static_cast<std::uint64_t>(missed));
    number_ += missed;
    elapsed_ = missed + 1;
    fresh_ = device_.read(reading_) == DeviceRead::kFresh;
    if (std::exchange(acknowledges_, false)) chain_.acknowledge();
    device_.write(chain_.tick(reading_, fresh_, elapsed_, 1.0, tick_));
    if (on_tick) on_tick();
    ++number_;
    return dueNs();
  }
  void rest(std::int64_t until_ns) noexcept override { time_.sleepUntilNs(until_ns); }

  /// It does nothing until then, as if it hung.
  void hangUntil(std::int64_t until_ns) { silent_until_ns_ = std::max(silent_until_ns_, until_ns); }
  void acknowledge() { acknowledges_ = true; }
  void stop() { stop_ = true; }

  [[nodiscard]] const ChainTick& tick() const { return tick_; }
  [[nodiscard]] const DeviceReading& reading() const { return reading_; }
  [[nodiscard]] const ForceGate& gate() const { return chain_.gate(); }
  [[nodiscard]] bool fresh() const { return fresh_; }
  [[nodiscard]] std::int64_t elapsedTicks() const { return elapsed_; }
  [[nodiscard]] std::int64_t lastTickNs() const { return last_tick_ns_; }
  [[nodiscard]] double force_N() const { return norm(tick_.rendered_W.force_N); }

  std::function<void()> on_tick;  ///< called after each tick

 private:
  [[nodiscard]] std::int64_t dueNs() const { return start_ns_ + number_ * kMs; }

  TimeSource& time_;
  Device& device_;
  HapticChain chain_;
  ChainTick tick_;
  DeviceReading reading_;
  std::int64_t start_ns_ = 0, number_ = 0, elapsed_ = 1, silent_until_ns_ = 0, last_tick_ns_ = 0;
  bool fresh_ = false, acknowledges_ = false, stop_ = false;
};

}  // namespace needlelab::test

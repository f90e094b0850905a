/// Common to all lessons in a simulated world, for any device: time, randomness, the haptic thread, the
/// gate's rules, and the first rule that was broken.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "client/device/device.h"
#include "tests/support/time/device_world.h"
#include "tests/support/time/gate_rules.h"
#include "tests/support/time/haptic_thread.h"

namespace needlelab::test {

/// The default: no troubles, nothing is late.
struct LessonPlan {
  std::uint64_t seed = 0;
  std::int64_t tick_late_ns = 0;  ///< greatest lateness of the haptic thread's wake-ups
  std::int64_t lasts_ns = 0;
  std::int64_t acknowledged_every_ns = 0;  ///< how often a person acknowledges; 0: never
  double stroke_s = 1;                     ///< of the hand, in and out
  bool six_layers = false;
};

class WorldRun {
 public:
  WorldRun(const WorldRun&) = delete;
  WorldRun& operator=(const WorldRun&) = delete;
  virtual ~WorldRun() = default;

  /// The first broken rule with its time; empty if all hold.
  [[nodiscard]] const std::string& broken() const { return broken_; }
  /// Hash of everything folded in: equal for equal runs.
  [[nodiscard]] std::uint64_t trace() const { return trace_; }
  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }

  mutable DeviceWorld world;  ///< nowNs is not const
  std::unique_ptr<HapticThread> haptic;

 protected:
  /// `gate_rate_hz`: the rate that the gate assumes; values other than 1000 plant a bug.
  WorldRun(const LessonPlan& plan, double gate_rate_hz);

  /// Makes `haptic`, which calls `on_tick` after each tick. `device` outlives it.
  void useDevice(Device& device, std::function<void()> on_tick);
  [[nodiscard]] std::int64_t now() const { return world.nowNs(); }
  void breakRule(const std::string& what);
  void fold(std::uint64_t value);
  /// Each wake-up of this thread is late by up to this much.
  void lateBy(const std::string& thread, std::int64_t max_ns);
  /// Call first after a tick: counts it, folds it in, and checks the gate's rules.
  void watchTick();
  /// From now on a person acknowledges as planned.
  void acknowledgeAsPlanned(const LessonPlan& plan);
  virtual void acknowledge() { haptic->acknowledge(); }
  /// A person acknowledges until ten ticks in a row have no fault and are good. Otherwise a rule is broken.
  void recoverWithin(std::int64_t max_ns, const std::function<bool()>& is_good);

  Random random_;
  std::unique_ptr<DeviceMaintenance> keeper_;
  std::unique_ptr<RunningTurns> haptic_thread_;

 private:
  SceneModel model_;
  Device* device_ = nullptr;
  std::unique_ptr<GateRules> rules_;
  std::string broken_;
  std::uint64_t trace_ = 0xcbf29ce484222325ull, ticks_ = 0;
};

}  // namespace needlelab::test

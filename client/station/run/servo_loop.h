/// The haptic loop: device → tool → gate → engine → gate → device, once a tick, and each tick into the ring
/// (DESIGN §1, §3.7).
#pragma once

#include <atomic>
#include <cstdint>

#include "client/device/haptic_chain.h"
#include "client/net/spool_writer.h"
#include "client/station/run/black_box.h"
#include "client/station/run/fault_policy.h"
#include "client/station/run/rt_thread.h"
#include "client/station/run/servo_stats.h"
#include "common/base/wait_free.h"

namespace needlelab {

struct ServoSettings {
  double rate_hz = 1000;
  Pose X_HT;                    ///< the tool: the tip in the handle's frame
  std::uint64_t max_ticks = 0;  ///< ends after so many ticks, missed ones included; 0 = no end
  FaultPolicy on_fault = FaultPolicy::kEnd;
  PlungerSettings plunger{};      ///< its source is the device's own, whatever stands here
  BlackBox* black_box = nullptr;  ///< outlives the loop; null = none
};

/// Thread: `run` on the haptic thread; what is said below for the others. Everything it needs is allocated
/// when it is made. Within a tick: no heap, lock, exception, and no system call but the clock's and the
/// device's.
class ServoLoop {
 public:
  /// All of them must outlive the loop; the device is open.
  ServoLoop(const SceneModel& model, Device& device, LoopClock& clock, SampleRing& ring,
            const ServoSettings& settings);

  /// Runs until the end, then leaves the device with zero force. Tick k is due at start + k/rate. When the
  /// loop wakes a period or more late, the ticks that passed are missed: the tick number goes on, they are
  /// not stepped. Before a planned end the force fades out within 20 ms; after a FAULT the gate does that.
  void run() noexcept;

  // from any thread; the first three also from a signal's handler
  /// Asks the loop to end.
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }
  /// Another part of the program died: FAULT (Fault::kProgramTrouble), zero force within 20 ms, then the loop
  /// ends, whatever the policy. Wait for `ended`, but not without end: a loop that itself died never ends.
  void crashStop() noexcept { crash_.store(true, std::memory_order_relaxed); }
  /// The loop has ended, and the device was left with zero force.
  [[nodiscard]] bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// A person has seen the fault that is there now. Counts once, in the next tick; a fault that comes later
  /// needs an acknowledgement of its own.
  void acknowledge() noexcept { acknowledged_.store(true, std::memory_order_relaxed); }
  /// The fault of the last tick.
  [[nodiscard]] Fault fault() const noexcept { return fault_.load(std::memory_order_relaxed); }
  /// In FAULT: its cause was there in the last tick, so that an acknowledgement does not count yet.
  [[nodiscard]] bool causeLasts() const noexcept { return cause_lasts_.load(std::memory_order_relaxed); }
  /// In FAULT: it is acknowledged and waits for the needle to be outside the tissue.
  [[nodiscard]] bool acknowledgementStands() const noexcept {
    return acknowledgement_stands_.load(std::memory_order_relaxed);
  }
  /// How often a fault was raised so far.
  [[nodiscard]] std::uint64_t faults() const noexcept { return faults_.load(std::memory_order_relaxed); }
  /// DeviceFlag bits of the last tick.
  [[nodiscard]] std::uint32_t condition() const noexcept {
    return condition_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] std::uint64_t missedTicks() const noexcept { return missed_.load(std::memory_order_relaxed); }

  /// From one other thread: true when `sample` is a newer tick than the last call gave.
  [[nodiscard]] bool latest(GestureSample& sample) noexcept { return latest_.fetch(sample); }

  [[nodiscard]] const ServoStats& stats() const noexcept { return stats_; }

 private:
  /// When a tick was due, and when each of its phases ended; what it missed.
  struct TickTimes {
    std::int64_t due_ns = 0, late_ns = 0;
    std::uint64_t missed = 0;
    std::int64_t began_ns = 0, read_ns = 0, computed_ns = 0, wrote_ns = 0, recorded_ns = 0;
    [[nodiscard]] std::int64_t device_ns() const noexcept {
      return (read_ns - began_ns) + (wrote_ns - computed_ns);
    }
    [[nodiscard]] std::int64_t engine_ns() const noexcept { return computed_ns - read_ns; }
  };

  [[nodiscard]] std::int64_t dueNs(std::uint64_t tick) const noexcept;
  [[nodiscard]] std::uint64_t miss(std::int64_t late_ns) noexcept;
  void hearOthers(std::uint64_t number) noexcept;
  bool tick(std::uint64_t number, TickTimes& times) noexcept;
  // servo_loop_record.cpp
  void record(DeviceRead read, TickTimes& times) noexcept;
  void publish(const TickTimes& times) noexcept;
  [[nodiscard]] bool noteFault() noexcept;
  void fill(BlackBoxTick& kept, DeviceRead read, const TickTimes& times) const noexcept;
  [[nodiscard]] ServoEnd endAfter(std::uint64_t number) noexcept;
  [[nodiscard]] double closingShare(std::uint64_t number) noexcept;

  Device& device_;
  LoopClock& clock_;
  SampleRing& ring_;
  ServoSettings settings_;
  double period_ns_;
  std::uint64_t closing_ticks_, after_fault_ticks_;
  HapticChain chain_;
  ChainTick chain_tick_{};
  DeviceReading reading_{};
  std::int64_t start_ns_ = 0;
  std::uint64_t closing_since_ = 0, fault_since_ = 0, crash_since_ = 0;
  bool closing_ = false, crashing_ = false;
  ServoStats stats_;
  MissedTickStorm storm_;

  // what others write and the loop reads, and the other way round
  alignas(64) std::atomic<bool> stop_{false};
  std::atomic<bool> crash_{false}, acknowledged_{false};
  alignas(64) std::atomic<bool> ended_{false};
  std::atomic<Fault> fault_{Fault::kNone};
  std::atomic<bool> cause_lasts_{false}, acknowledgement_stands_{false};
  std::atomic<std::uint32_t> condition_{0};
  std::atomic<std::uint64_t> faults_{0}, missed_{0};
  LatestValue<GestureSample> latest_;

  static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<Fault>::is_always_lock_free &&
                std::atomic<std::uint64_t>::is_always_lock_free);
};

}  // namespace needlelab

/// The haptic loop: device → tool → gate → engine → gate → device, once a tick, and each tick into the ring.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "client/device/haptic_chain.h"
#include "client/net/spool_writer.h"
#include "client/station/run/black_box.h"
#include "client/station/run/fault_watch.h"
#include "client/station/run/real_time.h"
#include "common/base/histogram.h"
#include "common/base/wait_free.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// Why the loop ended.
enum class ServoEnd : std::uint8_t {
  kNotYet,
  kStopped,         ///< on request
  kTicksDone,       ///< max_ticks
  kDeviceFinished,  ///< a recording or a hand's plan is over
  kFault,           ///< the gate took the force away, and the policy was kEnd; see `fault`
  kCrash,           ///< crashStop: another part of the program died
};

/// A fault of the lesson.
struct FaultNote {
  Fault fault = Fault::kNone;
  std::uint64_t tick = 0;                  ///< in which it was raised
  std::optional<std::uint64_t> over_tick;  ///< in which it was over: acknowledged, the needle outside
};

/// Thread: the histograms may be read while the loop runs; everything else when `run` has returned.
struct ServoStats {
  ServoEnd end = ServoEnd::kNotYet;
  Fault fault = Fault::kNone;        ///< that stood when the loop ended; none when it was over by then
  Fault first_fault = Fault::kNone;  ///< of the whole lesson
  std::uint64_t faults = 0;          ///< how often one was raised
  std::uint64_t fault_ticks = 0;     ///< ticks in FAULT
  static constexpr std::size_t kMostFaultNotes = 64;
  std::array<FaultNote, kMostFaultNotes> fault_notes{};  ///< of the first faults
  std::size_t fault_note_count = 0;
  std::uint64_t ticks = 0;         ///< that passed, missed ones included
  std::uint64_t samples = 0;       ///< ticks that ran: each gave one sample
  std::uint64_t missed_ticks = 0;  ///< that passed before the loop woke: not stepped, no sample
  std::uint64_t late_wakeups = 0;  ///< wake-ups late by a period or more: each missed one tick or several
  std::array<std::uint64_t, 32>
      flag_ticks{};         ///< bit i of StepFlag, GateFlag, DeviceFlag: in how many ticks it was set
  LatencyHistogram wakeup;  ///< how late after its due time a tick began
  LatencyHistogram tick;    ///< how long a tick worked: all of the following
  LatencyHistogram read;    ///< … the device's read
  LatencyHistogram engine;  ///< … tool, gate and engine
  LatencyHistogram write;   ///< … the device's write
  LatencyHistogram record;  ///< … the sample into its ring, and the values published to others
  LatencyHistogram device;  ///< read and write of a tick together

  /// Once per tick: the fault of this tick, and whether it was raised in it. Real-time safe.
  void noteFault(Fault now, bool raised, std::uint64_t tick_number) noexcept {
    if ((raised || now == Fault::kNone) && open_fault_) {
      fault_notes[fault_note_count - 1].over_tick = tick_number;
      open_fault_ = false;
    }
    if (!raised || fault_note_count == kMostFaultNotes) return;
    fault_notes[fault_note_count++] = {now, tick_number, std::nullopt};
    open_fault_ = true;
  }

 private:
  bool open_fault_ = false;
};

struct ServoSettings {
  double rate_hz = 1000;
  Pose X_HT;                    ///< the tool: the tip in the handle's frame
  std::uint64_t max_ticks = 0;  ///< ends after so many ticks, missed ones included; 0 = no end
  FaultPolicy on_fault = FaultPolicy::kEnd;
  PlungerSettings plunger{};      ///< its source is the device's own; `source` is ignored
  BlackBox* black_box = nullptr;  ///< outlives the loop; null = none
};

/// Thread: `run` on the haptic thread; the others as documented below. All memory is allocated in the
/// constructor. Within a tick: no heap, lock, exception, and no system call but the clock's and the device's.
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
  /// ends under any policy. Wait for `ended`, but with a time limit: a loop that itself died never ends.
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
  /// When a tick was due and when each of its phases ended; the ticks that it missed.
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
  [[nodiscard]] std::uint64_t countMissedTicks(std::int64_t late_ns) noexcept;
  void handleRequests(std::uint64_t number) noexcept;
  bool tick(std::uint64_t number, TickTimes& times) noexcept;
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

  // requests to the loop, and its published state
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

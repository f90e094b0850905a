/// The haptic loop: device → tool → gate → engine → gate → device, once a tick. Pushes each tick into the
/// ring.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "client/device/haptic_chain.h"
#include "client/net/spool/spool_writer.h"
#include "client/station/run/loop/black_box.h"
#include "client/station/run/loop/fault_watch.h"
#include "client/station/run/loop/real_time.h"
#include "common/base/histogram.h"
#include "common/base/wait_free.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// The reason for the loop's end.
enum class ServoEnd : std::uint8_t {
  kNotYet,
  kStopped,         ///< by request
  kTicksDone,       ///< max_ticks or needle_ticks
  kDeviceFinished,  ///< the recording or the hand's plan ended
  kFault,           ///< the gate removed the force under kEnd; see `fault`
  kCrash,           ///< crashStop: another part of the program died
};

/// A fault of the lesson.
struct FaultNote {
  Fault fault = Fault::kNone;
  std::uint64_t tick = 0;                  ///< tick that raised it
  std::optional<std::uint64_t> over_tick;  ///< tick that ended it: acknowledged, the needle outside
};

/// Thread: other threads may read the histograms while the loop runs, everything else after `run` returned.
struct ServoStats {
  ServoEnd end = ServoEnd::kNotYet;
  Fault fault = Fault::kNone;        ///< fault at the loop's end; none if it was over
  Fault first_fault = Fault::kNone;  ///< first fault of the lesson
  std::uint64_t faults = 0;          ///< number of faults
  std::uint64_t fault_ticks = 0;     ///< ticks in FAULT
  static constexpr std::size_t kMaxFaultNotes = 64;
  std::array<FaultNote, kMaxFaultNotes> fault_notes{};  ///< the first faults
  std::size_t fault_note_count = 0;
  std::uint64_t ticks = 0;    ///< elapsed ticks, including missed ones
  std::uint64_t samples = 0;  ///< executed ticks; each gave one sample
  /// Ticks that passed before the loop woke, without engine step or sample. Counts only ticks before the end
  /// of the lesson and of a recording that it plays.
  std::uint64_t missed_ticks = 0;
  std::uint64_t late_wakeups = 0;  ///< wake-ups late by a period or more; each missed at least one tick
  std::array<std::uint64_t, 32>
      flag_ticks{};         ///< number of ticks with bit i of StepFlag, GateFlag or DeviceFlag
  LatencyHistogram wakeup;  ///< delay between a tick's due time and its beginning
  LatencyHistogram tick;    ///< duration of a tick: all of the following
  LatencyHistogram read;    ///< … the device's read
  LatencyHistogram engine;  ///< … tool, gate and engine
  LatencyHistogram write;   ///< … the device's write
  LatencyHistogram record;  ///< … the push into the ring and the published values
  LatencyHistogram device;  ///< read and write of a tick together

  /// Call once per tick with its fault, and whether this tick raised it. Real-time safe.
  void noteFault(Fault now, bool raised, std::uint64_t tick_number) noexcept {
    if ((raised || now == Fault::kNone) && open_fault_) {
      fault_notes[fault_note_count - 1].over_tick = tick_number;
      open_fault_ = false;
    }
    if (!raised || fault_note_count == kMaxFaultNotes) return;
    fault_notes[fault_note_count++] = {now, tick_number, std::nullopt};
    open_fault_ = true;
  }

 private:
  bool open_fault_ = false;
};

struct ServoSettings {
  double rate_hz = 1000;
  Pose X_HT;                    ///< the tool: the tip in the handle's frame
  std::uint64_t max_ticks = 0;  ///< ends after this many ticks, including missed ones; 0: no end
  FaultPolicy on_fault = FaultPolicy::kEnd;
  std::optional<PassivitySettings> passivity = {};  ///< none: no passivity control
  PlungerSettings plunger{};                        ///< ignores `source`; the device determines it
  BlackBox* black_box = nullptr;                    ///< must outlive the loop; null: none
  bool starts_capped = false;                       ///< in a scene with PALPATION
  /// Ends one tick more than this after the uncapped needle's first tick in tissue; 0: does not.
  std::uint64_t needle_ticks = 0;
};

/// Thread: `run` on the haptic thread; the others as documented below. The constructor allocates all memory.
/// A tick uses no heap, lock or exception, and no system calls except those of the clock and the device.
class ServoLoop {
 public:
  /// All arguments must outlive the loop; the device is open. `paths` makes the paths in a body; null: they
  /// are made in place, which is not real-time safe.
  ServoLoop(const SceneModel& model, Device& device, TimeSource& clock, SampleRing& ring,
            const ServoSettings& settings, PathMaker* paths = nullptr);

  /// Runs until the end, then leaves the device with zero force. Tick k is due at start + k/rate. If the loop
  /// wakes a period or more late, it misses the elapsed ticks: it skips their numbers and does not step the
  /// engine. The force fades out within 20 ms before a planned end; after a FAULT the gate does that.
  void run() noexcept;

  // callable from any thread; the first three also from a signal handler
  /// Asks the loop to end.
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }
  /// Call if another part of the program crashed: FAULT (Fault::kProgramTrouble), zero force within 20 ms,
  /// then the loop ends under any policy. Wait for `ended` with a time limit: if the loop itself crashed, it
  /// never ends.
  void crashStop() noexcept { crash_.store(true, std::memory_order_relaxed); }
  /// Returns whether the loop has ended and left the device with zero force.
  [[nodiscard]] bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// Acknowledges the present fault for a person. Counts once, in the next tick; each later fault needs its
  /// own acknowledgement.
  void acknowledge() noexcept { acknowledged_.store(true, std::memory_order_relaxed); }
  /// Takes the needle's cap off or puts it on (HapticChain::switchCap), in the next tick.
  void switchCap() noexcept { switches_cap_.store(true, std::memory_order_relaxed); }
  /// Returns the fault of the last tick.
  [[nodiscard]] Fault fault() const noexcept { return fault_.load(std::memory_order_relaxed); }
  /// In FAULT: its cause persisted in the last tick, so an acknowledgement does not count yet.
  [[nodiscard]] bool causeLasts() const noexcept { return cause_lasts_.load(std::memory_order_relaxed); }
  /// In FAULT: a person acknowledged it, and the loop waits until the needle is outside the tissue.
  [[nodiscard]] bool isAcknowledged() const noexcept {
    return is_acknowledged_.load(std::memory_order_relaxed);
  }
  /// Number of faults so far.
  [[nodiscard]] std::uint64_t faults() const noexcept { return faults_.load(std::memory_order_relaxed); }
  /// DeviceFlag bits of the last tick.
  [[nodiscard]] std::uint32_t condition() const noexcept {
    return condition_.load(std::memory_order_relaxed);
  }
  /// The number of the uncapped needle's first tick in tissue; empty: none yet.
  [[nodiscard]] std::optional<std::uint64_t> firstContact() const noexcept {
    const std::uint64_t next = after_contact_.load(std::memory_order_relaxed);
    return next > 0 ? std::optional(next - 1) : std::nullopt;
  }
  [[nodiscard]] std::uint64_t missedTicks() const noexcept { return missed_.load(std::memory_order_relaxed); }

  /// For one other thread. Returns true if `sample` is newer than that of the last call.
  [[nodiscard]] bool latest(GestureSample& sample) noexcept { return latest_.fetch(sample); }

  [[nodiscard]] const ServoStats& stats() const noexcept { return stats_; }

 private:
  /// A tick's due time, the end of each phase, and the missed ticks before it.
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
  [[nodiscard]] std::uint64_t countMissedTicks(std::uint64_t number, std::int64_t late_ns) noexcept;
  void handleRequests(std::uint64_t number) noexcept;
  bool tick(std::uint64_t number, TickTimes& times) noexcept;
  void record(DeviceRead read, TickTimes& times) noexcept;
  void publish(const TickTimes& times) noexcept;
  void noteContact(const GestureSample& sample) noexcept;
  [[nodiscard]] bool noteFault() noexcept;
  void fill(BlackBoxTick& kept, DeviceRead read, const TickTimes& times) const noexcept;
  [[nodiscard]] ServoEnd endAfter(std::uint64_t number) noexcept;
  [[nodiscard]] double closingShare(std::uint64_t number) noexcept;

  Device& device_;
  TimeSource& clock_;
  SampleRing& ring_;
  ServoSettings settings_;
  double period_ns_;
  std::uint64_t closing_ticks_, after_fault_ticks_;
  std::uint64_t end_tick_;  // the first tick that is not run; 0: no end
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
  std::atomic<bool> crash_{false}, acknowledged_{false}, switches_cap_{false};
  alignas(64) std::atomic<bool> ended_{false};
  std::atomic<Fault> fault_{Fault::kNone};
  std::atomic<bool> cause_lasts_{false}, is_acknowledged_{false};
  std::atomic<std::uint32_t> condition_{0};
  std::atomic<std::uint64_t> faults_{0}, missed_{0}, after_contact_{0};
  LatestValue<GestureSample> latest_;

  static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<Fault>::is_always_lock_free &&
                std::atomic<std::uint64_t>::is_always_lock_free);
};

}  // namespace needlelab

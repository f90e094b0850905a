/// The haptic loop: device → tool → gate → engine → gate → device, once a tick, and each tick into the ring
/// (DESIGN §1, §3.7).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "device/haptic_chain.h"
#include "net/spool_writer.h"
#include "station/latency_histogram.h"
#include "station/rt_thread.h"

namespace needlelab {

struct ServoSettings {
  double rate_hz = 1000;
  Pose X_HT;                    ///< the tool: the tip in the handle's frame
  std::uint64_t max_ticks = 0;  ///< ends after so many ticks, missed ones included; 0 = no end
};

/// Why the loop ended.
enum class ServoEnd : std::uint8_t {
  kNotYet,
  kStopped,         ///< asked to
  kTicksDone,       ///< max_ticks
  kDeviceFinished,  ///< a recording or a hand's plan is over
  kFault,           ///< the gate took the force away; see `fault`
};

/// What the loop counted. Read it when `run` has returned.
struct ServoStats {
  ServoEnd end = ServoEnd::kNotYet;
  Fault fault = Fault::kNone;
  std::uint64_t ticks = 0;         ///< that passed, missed ones included
  std::uint64_t samples = 0;       ///< ticks that ran: each gave one sample
  std::uint64_t missed_ticks = 0;  ///< that passed before the loop woke: not stepped, no sample
  std::array<std::uint64_t, 32>
      flag_ticks{};         ///< bit i of StepFlag and GateFlag: in how many ticks it was set
  LatencyHistogram wakeup;  ///< how late after its due time a tick began
  LatencyHistogram tick;    ///< how long a tick worked, device included
  LatencyHistogram engine;  ///< … of it engine and gate
  LatencyHistogram device;  ///< … of it the device's read and write
};

/// Thread: `run` on the haptic thread; `stop`, `missedTicks` from any. Everything it needs is allocated when
/// it is made. Within a tick: no heap, lock, exception, and no system call but the clock's and the device's.
class ServoLoop {
 public:
  /// All of them must outlive the loop; the device is open.
  ServoLoop(const SceneModel& model, Device& device, LoopClock& clock, SampleRing& ring,
            const ServoSettings& settings);

  /// Runs until the end, then leaves the device with zero force. Tick k is due at start + k/rate. When the
  /// loop wakes a period or more late, the ticks that passed are missed: the tick number goes on, they are
  /// not stepped. Before a planned end the force fades out within 20 ms; after a FAULT the gate does that.
  void run() noexcept;
  /// Asks the loop to end. Signal-safe.
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }

  [[nodiscard]] const ServoStats& stats() const noexcept { return stats_; }
  [[nodiscard]] std::uint64_t missedTicks() const noexcept { return missed_.load(std::memory_order_relaxed); }

 private:
  [[nodiscard]] std::int64_t dueNs(std::uint64_t tick) const noexcept;
  bool tick(std::uint64_t number, std::int64_t due_ns, std::int64_t began_ns,
            std::int64_t elapsed_ticks) noexcept;
  void record(std::int64_t due_ns, std::int64_t device_ns, std::int64_t engine_ns) noexcept;
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
  std::uint64_t closing_since_ = 0;
  std::uint64_t fault_since_ = 0;
  bool closing_ = false;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> missed_{0};
  ServoStats stats_;
};

}  // namespace needlelab

/// A loop that reads the device at its rate and gives it no force: for `--self-test` and `--calibrate`. It
/// has neither engine nor gate: the only wrench that it can make is zero (force_gate.h, GuardedWrench).
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/station/run/real_time.h"
#include "common/base/histogram.h"

namespace needlelab {

struct ZeroForceSettings {
  double rate_hz = 1000;
  std::uint64_t max_ticks = 0;   ///< ends after so many, missed ones included; more than 0
  std::uint64_t keep_every = 1;  ///< of the fresh readings, one in so many is kept
};

/// A reading that was kept.
struct ZeroForceSample {
  double t_s = 0;  ///< since the first tick
  Pose X_WH;
  double speed_mps = 0;
};

/// Counts of the loop. Read them when `run` has returned.
struct ZeroForceStats {
  std::uint64_t ticks = 0;  ///< that passed, missed ones included
  std::uint64_t ran = 0;    ///< ticks that ran
  std::uint64_t missed = 0;
  std::uint64_t fresh = 0;                          ///< readings with a new pose
  std::uint64_t longest_silence = 0;                ///< ticks in a row without one, missed ones not counted
  std::uint64_t bad_poses = 0;                      ///< not finite, or no rotation
  std::array<std::uint64_t, 32> condition_ticks{};  ///< bit i of DeviceFlag: in how many ticks it was set
  std::uint32_t last_condition = 0;
  std::uint32_t buttons_seen = 0;
  double least_plunger = 1, greatest_plunger = 0;
  double greatest_speed_mps = 0;  ///< as the device reports it
  bool device_finished = false;   ///< a recording came to its end
  double seconds = 0;             ///< between the first and the last tick
  LatencyHistogram wakeup;        ///< how late after its due time a tick began
  LatencyHistogram exchange;      ///< the device's read and write
};

/// Thread: `run` on the haptic thread; `stop`, `samples` from any. Within a tick: no heap, lock, exception.
class ZeroForceLoop {
 public:
  /// Both must outlive the loop; the device is open.
  ZeroForceLoop(Device& device, LoopClock& clock, const ZeroForceSettings& settings);

  /// Until max_ticks, `stop` or the end of a recording. The device is left with zero force.
  void run() noexcept;
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }

  /// The samples kept so far; valid as long as the loop.
  [[nodiscard]] std::span<const ZeroForceSample> samples() const noexcept {
    return {kept_.data(), kept_count_.load(std::memory_order_acquire)};
  }
  /// Since the first tick, in device time; for progress.
  [[nodiscard]] double elapsed_s() const noexcept {
    return static_cast<double>(elapsed_ticks_.load(std::memory_order_relaxed)) / settings_.rate_hz;
  }
  [[nodiscard]] std::uint32_t condition() const noexcept {
    return condition_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] const ZeroForceStats& stats() const noexcept { return stats_; }

 private:
  void tick(std::uint64_t number) noexcept;
  void keep(std::uint64_t number) noexcept;

  Device& device_;
  LoopClock& clock_;
  ZeroForceSettings settings_;
  DeviceReading reading_;
  std::vector<ZeroForceSample>
      kept_;  // its size never changes: the loop fills, others read up to kept_count_
  std::atomic<std::size_t> kept_count_{0};
  std::atomic<std::uint64_t> elapsed_ticks_{0};
  std::atomic<std::uint32_t> condition_{0};
  std::atomic<bool> stop_{false};
  std::uint64_t silence_ = 0;
  ZeroForceStats stats_;
};

/// How a run on the haptic thread went.
struct ZeroForceRun {
  std::vector<RtStep> realtime;  ///< as the lesson has them
  bool stopped = false;          ///< by a signal
};
/// Runs the loop on a thread of its own, as real-time as the lesson's with `real_time`
/// (null: an ordinary one); meanwhile this thread
/// looks after the device (maintain) and calls `progress` 20 times a second. `progress` returns false to end
/// the loop. A stop signal (they are blocked) ends it, too.
ZeroForceRun runZeroForceLoop(ZeroForceLoop& loop, Device& device, const RtOptions* real_time,
                              const sigset_t& stop_signals, const std::function<bool()>& progress);

/// A clock that never waits: for devices that live by the tick, such as a recording.
class ImpatientClock final : public LoopClock {
 public:
  std::int64_t nowNs() noexcept override { return now_ns_; }
  void sleepUntilNs(std::int64_t due_ns) noexcept override { now_ns_ = due_ns; }

 private:
  std::int64_t now_ns_ = 0;
};

}  // namespace needlelab

/// A loop for `--self-test` and `--calibrate` that reads the device at its rate and writes zero force. It has
/// no engine and no gate: the only wrench that it can make is zero (force_gate.h, GuardedWrench). ProbeLoop
/// (measure_delay.h) gives small forces instead, through a gate of its own.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/device/device.h"
#include "client/device/turns.h"
#include "client/station/run/loop/real_time.h"
#include "common/base/histogram.h"
#include "common/base/time/time_source.h"

namespace needlelab {

struct ZeroForceSettings {
  double rate_hz = 1000;
  std::uint64_t max_ticks = 0;   ///< ends after this many ticks, including missed ones; > 0
  std::uint64_t keep_every = 1;  ///< keeps every n-th fresh reading
};

/// A kept reading.
struct ZeroForceSample {
  double t_s = 0;  ///< since the first tick
  Pose X_WH;
  double speed_mps = 0;
};

/// Counters of the loop. Read them after `run` returned.
struct ZeroForceStats {
  std::uint64_t ticks = 0;  ///< elapsed ticks, including missed ones
  std::uint64_t ran = 0;    ///< executed ticks
  std::uint64_t missed = 0;
  std::uint64_t fresh = 0;            ///< readings with a new pose
  std::uint64_t longest_silence = 0;  ///< consecutive ticks without a new pose, without missed ticks
  std::uint64_t bad_poses = 0;        ///< not finite, or not a rotation
  std::array<std::uint64_t, 32> condition_ticks{};  ///< number of ticks with bit i of DeviceFlag
  std::uint32_t last_condition = 0;
  std::uint32_t buttons_seen = 0;
  double min_plunger = 1, greatest_plunger = 0;
  double greatest_speed_mps = 0;  ///< as the device reports it
  bool device_finished = false;   ///< the recording ended
  double seconds = 0;             ///< between the first and the last tick
  LatencyHistogram wakeup;        ///< delay between a tick's due time and its beginning
  LatencyHistogram exchange;      ///< the device's read and write
};

/// Thread: `run`, or `turn` and `rest`, on the haptic thread; `stop`, `samples` from any. A tick uses no
/// heap, lock or exception.
class ZeroForceLoop : public Turns {
 public:
  /// Both must outlive the loop; the device is open.
  ZeroForceLoop(Device& device, TimeSource& clock, const ZeroForceSettings& settings);

  /// Runs until max_ticks, `stop` or the end of a recording, then leaves the device with zero force.
  void run() noexcept;
  /// One tick of `run`; the first call only sets the first tick's time.
  std::optional<std::int64_t> turn() noexcept override;
  void rest(std::int64_t until_ns) noexcept override { clock_.sleepUntilNs(until_ns); }
  void stop() noexcept { stop_.store(true, std::memory_order_relaxed); }

  /// Returns the samples kept so far; valid during the loop's lifetime.
  [[nodiscard]] std::span<const ZeroForceSample> samples() const noexcept {
    return {kept_.data(), kept_count_.load(std::memory_order_acquire)};
  }
  /// Returns the device time since the first tick, for progress.
  [[nodiscard]] double elapsed_s() const noexcept {
    return static_cast<double>(elapsed_ticks_.load(std::memory_order_relaxed)) / settings_.rate_hz;
  }
  [[nodiscard]] std::uint32_t condition() const noexcept {
    return condition_.load(std::memory_order_relaxed);
  }
  [[nodiscard]] const ZeroForceStats& stats() const noexcept { return stats_; }

 protected:
  /// Returns the wrench of this tick; `number` includes missed ticks.
  virtual GuardedWrench answer(std::uint64_t, DeviceRead, const DeviceReading&) noexcept { return {}; }

 private:
  [[nodiscard]] std::int64_t dueNs() const noexcept;  // of the tick `number_`
  void wake() noexcept;
  void tick(std::uint64_t number) noexcept;
  void keep(std::uint64_t number) noexcept;

  Device& device_;
  TimeSource& clock_;
  ZeroForceSettings settings_;
  double period_ns_;
  DeviceReading reading_;
  bool begun_ = false;
  std::int64_t start_ns_ = 0;
  std::uint64_t number_ = 0;           // of the next tick
  std::vector<ZeroForceSample> kept_;  // fixed size: the loop writes, others read up to kept_count_
  std::atomic<std::size_t> kept_count_{0};
  std::atomic<std::uint64_t> elapsed_ticks_{0};
  std::atomic<std::uint32_t> condition_{0};
  std::atomic<bool> stop_{false};
  std::uint64_t silence_ = 0;
  ZeroForceStats stats_;
};

/// The result of a run on the haptic thread.
struct ZeroForceRun {
  std::vector<RtStep> realtime;  ///< the same steps as in a lesson
  bool stopped = false;          ///< by a signal
};
/// Runs the loop on its own thread, with a lesson's real-time settings from `real_time` (null: an ordinary
/// thread). Meanwhile the calling thread maintains the device (maintain) and calls `progress` 20 times a
/// second of `time`, which may differ from the loop's. The loop ends when `progress` returns false (it is
/// then not called again) or on a stop signal (the signals are blocked).
ZeroForceRun runZeroForceLoop(ZeroForceLoop& loop, Device& device, const RtOptions* real_time,
                              const sigset_t& stop_signals, const std::function<bool()>& progress,
                              TimeSource& time = machineTime(), TurnRunner& threads = machineThreads());

/// A clock that never waits, for devices that advance by ticks, such as a recording.
class ImpatientClock final : public TimeSource {
 public:
  std::int64_t nowNs() noexcept override { return now_ns_; }
  void sleepUntilNs(std::int64_t due_ns) noexcept override { now_ns_ = due_ns; }

 private:
  std::int64_t now_ns_ = 0;
};

}  // namespace needlelab

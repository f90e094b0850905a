/// Keeps the last 2 s of the haptic loop when something goes wrong. Another thread writes them to files.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "client/device/device.h"
#include "common/base/time/time_source.h"
#include "common/base/wait_free.h"

namespace needlelab {

/// Poses and wrenches in W; H handle, T tip.
struct BlackBoxTick {
  std::uint64_t tick = 0;           ///< number in the loop; numbers of missed ticks are skipped
  std::uint64_t missed_before = 0;  ///< ticks missed just before this one
  std::int64_t due_ns = 0;          ///< station's steady clock
  std::int64_t late_ns = 0;         ///< how late the loop woke; counted from the tick it slept for
  std::int64_t read_ns = 0, engine_ns = 0, write_ns = 0, record_ns = 0;  ///< duration of each phase
  DeviceReading reading;                ///< from the device, before any check
  bool fresh = false;                   ///< false: no new reading; `reading` is the previous one
  Pose X_WT;                            ///< tip pose in the last tick without a rejected sample
  Wrench wanted_W;                      ///< the engine's, about the tip, before the gate
  Wrench rendered_W;                    ///< the gate's, at the handle: the device's wrench
  double depth_m = 0, insertion_m = 0;  ///< δ and d_t
  double speed_mps = 0;                 ///< the engine's v
  std::uint32_t flags = 0;              ///< StepFlag | GateFlag | DeviceFlag
  std::int8_t layer = -1;
  std::uint8_t phase = 0;  ///< needlelab::Phase
  std::uint8_t fault = 0;  ///< needlelab::Fault
};
static_assert(std::is_trivially_copyable_v<BlackBoxTick>);

/// The trigger of a black box.
enum class BlackBoxCause : std::uint8_t {
  kFault,        ///< the gate raised a fault
  kMissedTicks,  ///< the loop missed 20 ms of ticks, at once or within a short time
};

/// One kept range of ticks.
struct BlackBoxDump {
  std::uint32_t number = 0;                     ///< counts from 1 in each session
  BlackBoxCause cause = BlackBoxCause::kFault;  ///< cause of the first trigger
  Fault fault = Fault::kNone;                   ///< fault at the first trigger
  std::uint64_t tick = 0;                       ///< tick of the first trigger
  std::uint32_t triggers = 0;                   ///< number of triggers in this range
  std::uint64_t first = 0, count = 0;           ///< position in the ring; internal
};

/// A ring of ticks, allocated once. A trigger marks the 2 s before it and the 50 ms after it; further
/// triggers in that time extend the range, up to 0.5 s after the first. The box then offers the range to the
/// reader, and the loop continues to write into the rest of the ring, which holds another second. The loop
/// never overwrites ticks that the reader has not copied: the box refuses and counts new ticks. Thread:
/// `next`, `commit`, `trigger`, `finish` by the haptic thread, real-time safe; `take` by one reader; the
/// counts by any.
class BlackBox {
 public:
  /// Keeps at most `max_dumps` (1-32) ranges and counts later triggers.
  explicit BlackBox(double rate_hz, std::uint32_t max_dumps = 10);

  /// Returns the slot for this tick.
  BlackBoxTick& next() noexcept;
  /// Completes the tick of `next`.
  void commit() noexcept;
  /// Reports trouble in the tick of `next`, before its commit.
  void trigger(BlackBoxCause cause, Fault fault, std::uint64_t tick) noexcept;
  /// Call at the loop's end. Offers an open range as it is.
  void finish() noexcept;

  /// Takes the next range and replaces `ticks`. Returns false if no range is ready.
  bool take(BlackBoxDump& dump, std::vector<BlackBoxTick>& ticks);

  /// The longest range.
  [[nodiscard]] std::size_t mostTicks() const noexcept { return before_ + longest_after_ + 1; }
  /// Number of all triggers.
  [[nodiscard]] std::uint64_t triggers() const noexcept { return triggers_.load(std::memory_order_relaxed); }
  /// Number of triggers after `max_dumps`; the box kept no range for them.
  [[nodiscard]] std::uint64_t droppedDumps() const noexcept {
    return not_kept_.load(std::memory_order_relaxed);
  }
  /// Number of ticks refused because the reader was more than a second late.
  [[nodiscard]] std::uint64_t ticksRefused() const noexcept {
    return refused_.load(std::memory_order_relaxed);
  }

 private:
  static constexpr std::uint32_t kMaxDumps = 32;
  void offer() noexcept;
  [[nodiscard]] bool full() noexcept;

  std::uint64_t before_, after_, longest_after_;  // in ticks
  std::uint32_t max_dumps_;
  std::vector<BlackBoxTick> ring_;
  BlackBoxTick nowhere_;

  // used by the haptic thread only
  std::uint64_t written_ = 0;  // ticks committed so far; tick n is in slot n modulo the ring's size
  bool open_ = false, refused_last_ = false;
  BlackBoxDump dump_;
  std::uint64_t opened_at_ = 0, ends_at_ = 0;
  std::uint32_t offered_ = 0;                      // ranges so far
  std::array<std::uint64_t, kMaxDumps> firsts_{};  // the first tick of each

  SpscRing<BlackBoxDump, kMaxDumps> dumps_;
  alignas(64) std::atomic<std::uint32_t> taken_{0};  // ranges copied by the reader
  alignas(64) std::atomic<std::uint64_t> triggers_{0};
  std::atomic<std::uint64_t> not_kept_{0}, refused_{0};
};

/// Detects storms of missed ticks: more than 20 ms of them, at once or gradually. One tick in 20 is forgiven.
/// Thread: one.
class MissedTickStorm {
 public:
  explicit MissedTickStorm(double rate_hz) : most_(0.02 * rate_hz) {}
  /// Call once per executed tick with the number of ticks missed just before it. Returns true when a storm
  /// begins. The storm ends, and another can begin, when half of it is forgiven.
  bool note(std::uint64_t missed) noexcept {
    constexpr double kForgiven = 0.05;
    const auto count = static_cast<double>(missed);
    level_ = level_ + count - kForgiven * (count + 1);
    if (level_ < 0) level_ = 0;
    if (level_ < most_ / 2) storm_ = false;
    if (storm_ || level_ <= most_) return false;
    storm_ = true;
    return true;
  }

 private:
  double most_, level_ = 0;
  bool storm_ = false;
};

/// Returns the reason for the range: "black box 1: the emergency stop is pressed, at tick 4711".
std::string blackBoxText(const BlackBoxDump& dump);

/// Counters of a session's black box.
struct BlackBoxCounts {
  std::uint64_t triggers = 0;       ///< faults and storms of missed ticks
  std::uint64_t files = 0;          ///< written
  std::uint64_t not_written = 0;    ///< ranges that the disk refused
  std::uint64_t not_kept = 0;       ///< triggers beyond the session's limit
  std::uint64_t ticks_refused = 0;  ///< ticks refused because the ring was full
};

/// Writes FOLDER/SESSION-NN.csv and creates the folder with the first file. Thread: one thread constructs,
/// finishes and destroys it; any calls `counts`; `log` runs on the writer's own thread.
class BlackBoxWriter {
 public:
  /// `box` and `time` must outlive the writer. `log` receives messages for a person: the written file, or why
  /// it was not written. Without `own_thread`, the owner calls `pass` when it is due.
  BlackBoxWriter(BlackBox& box, std::filesystem::path folder, std::string session,
                 std::function<void(const std::string&)> log, TimeSource& time = machineTime(),
                 bool own_thread = true);
  ~BlackBoxWriter() { finish(); }
  BlackBoxWriter(const BlackBoxWriter&) = delete;
  BlackBoxWriter& operator=(const BlackBoxWriter&) = delete;

  /// Call after the loop's end. Writes the remaining ranges, logs the losses, joins the thread. Repeated
  /// calls are allowed.
  void finish();
  /// One pass: writes the complete ranges. Returns when the next pass is due.
  std::int64_t pass();
  [[nodiscard]] BlackBoxCounts counts() const noexcept;

 private:
  void run();

  BlackBox& box_;
  std::filesystem::path folder_;
  std::string session_;
  std::function<void(const std::string&)> log_;
  std::vector<BlackBoxTick> ticks_;  // used by the writing thread only, like `text_`
  std::string text_;
  std::atomic<std::uint64_t> files_{0}, not_written_{0};
  TimeSource& time_;
  std::mutex mutex_;
  std::condition_variable finish_ordered_;
  bool finish_ = false;    // guarded by mutex_
  bool finished_ = false;  // used by the owner's thread only
  std::thread thread_;
};

/// Removes black boxes older than `age_s` and returns their number. Ignores files that it cannot remove.
std::size_t removeOldBlackBoxes(const std::filesystem::path& folder, std::int64_t age_s);

}  // namespace needlelab

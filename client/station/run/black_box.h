/// The last 2 s of the haptic loop, kept when something goes wrong, and written to files beside the loop.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

#include "client/device/device.h"
#include "common/base/wait_free.h"

namespace needlelab {

/// Poses and wrenches in W; H handle, T tip.
struct BlackBoxTick {
  std::uint64_t tick = 0;           ///< of the loop; a gap: missed, see `missed_before`
  std::uint64_t missed_before = 0;  ///< ticks that passed unseen just before this one
  std::int64_t due_ns = 0;          ///< station's steady clock
  std::int64_t late_ns = 0;         ///< how late the loop woke, for the tick that it had slept for
  std::int64_t read_ns = 0, engine_ns = 0, write_ns = 0, record_ns = 0;  ///< how long each phase took
  DeviceReading reading;                ///< as the device gave it, before any check
  bool fresh = false;                   ///< false: the device gave nothing new, `reading` is the last one
  Pose X_WT;                            ///< of the last tick whose sample was not rejected
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

/// Why the black box was kept.
enum class BlackBoxCause : std::uint8_t {
  kFault,        ///< the gate raised a fault
  kMissedTicks,  ///< 20 ms of ticks were missed, at once or within a short time
};

/// One stretch of ticks that is kept.
struct BlackBoxDump {
  std::uint32_t number = 0;                     ///< of the session, from 1
  BlackBoxCause cause = BlackBoxCause::kFault;  ///< of the first trigger in it
  Fault fault = Fault::kNone;                   ///< that stood at the first trigger
  std::uint64_t tick = 0;                       ///< at which that was
  std::uint32_t triggers = 0;                   ///< how many fell into this stretch
  std::uint64_t first = 0, count = 0;           ///< where it lies in the ring: the box's own
};

/// A ring of ticks, made once. A trigger marks the 2 s before and the 50 ms after it (further triggers in
/// that time make it longer, up to 0.5 s); the stretch is then offered to the reader, and the loop goes on
/// writing into the rest of the ring, which holds another second. Ticks that the reader has not copied by
/// then stay whole: new ticks are refused and counted. Thread: `next`, `commit`, `trigger`, `finish` by the
/// haptic thread, real-time safe; `take` by one reader; the counts by any.
class BlackBox {
 public:
  /// `max_dumps` (1-32) stretches are kept in all; triggers after that are counted.
  explicit BlackBox(double rate_hz, std::uint32_t max_dumps = 10);

  /// Where this tick goes.
  BlackBoxTick& next() noexcept;
  /// The tick of `next` is complete.
  void commit() noexcept;
  /// Something went wrong in the tick of `next`, which is not committed yet.
  void trigger(BlackBoxCause cause, Fault fault, std::uint64_t tick) noexcept;
  /// The loop ends: an open stretch is offered as it is.
  void finish() noexcept;

  /// The next stretch; false when there is none. `ticks` is replaced.
  bool take(BlackBoxDump& dump, std::vector<BlackBoxTick>& ticks);

  /// All triggers.
  [[nodiscard]] std::uint64_t triggers() const noexcept { return triggers_.load(std::memory_order_relaxed); }
  /// Triggers without a stretch, after `max_dumps`.
  [[nodiscard]] std::uint64_t notKept() const noexcept { return not_kept_.load(std::memory_order_relaxed); }
  /// Ticks that found no place: the reader was more than a second late.
  [[nodiscard]] std::uint64_t ticksRefused() const noexcept {
    return refused_.load(std::memory_order_relaxed);
  }

 private:
  static constexpr std::uint32_t kMostDumps = 32;
  void offer() noexcept;
  [[nodiscard]] bool full() noexcept;

  std::uint64_t before_, after_, longest_after_;  // in ticks
  std::uint32_t max_dumps_;
  std::vector<BlackBoxTick> ring_;
  BlackBoxTick nowhere_;

  // the haptic thread's own
  std::uint64_t written_ = 0;  // ticks committed so far; tick n of them is in slot n modulo the ring's size
  bool open_ = false, refused_last_ = false;
  BlackBoxDump dump_;
  std::uint64_t opened_at_ = 0, ends_at_ = 0;
  std::uint32_t offered_ = 0;                       // stretches so far
  std::array<std::uint64_t, kMostDumps> firsts_{};  // the first tick of each

  SpscRing<BlackBoxDump, kMostDumps> dumps_;
  alignas(64) std::atomic<std::uint32_t> taken_{0};  // stretches that the reader has copied
  alignas(64) std::atomic<std::uint64_t> triggers_{0};
  std::atomic<std::uint64_t> not_kept_{0}, refused_{0};
};

/// Detects storms of missed ticks: more than 20 ms of them, at once or bit by
/// bit, where one tick in 20 is forgiven. Thread: one.
class MissedTickStorm {
 public:
  explicit MissedTickStorm(double rate_hz) : most_(0.02 * rate_hz) {}
  /// Once per tick that ran, with the number that was missed just before it: true when a storm begins. It is
  /// over, and may begin again, once half of it is forgiven.
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

/// A header with units (README.md of this folder says what each column is), then a row per tick. Numbers read
/// back bit by bit.
std::string blackBoxCsv(const std::vector<BlackBoxTick>& ticks);

/// "black box 1: the emergency stop is pressed, at tick 4711": why the stretch was kept.
std::string blackBoxText(const BlackBoxDump& dump);

/// Counts of a session's black box.
struct BlackBoxCounts {
  std::uint64_t triggers = 0;       ///< faults and storms of missed ticks
  std::uint64_t files = 0;          ///< written
  std::uint64_t not_written = 0;    ///< stretches that the disk refused
  std::uint64_t not_kept = 0;       ///< triggers beyond the most that is kept of a session
  std::uint64_t ticks_refused = 0;  ///< ticks that found the ring full
};

/// Files are FOLDER/SESSION-NN.csv; the folder is made when the first one is written.
/// Thread: made, `finish`ed and destroyed by one; `counts` by any; `log` runs on the writer's own thread.
class BlackBoxWriter {
 public:
  /// `box` must outlive the writer. `log` gets a message for a person: the file that was written, or why none
  /// was.
  BlackBoxWriter(BlackBox& box, std::filesystem::path folder, std::string session,
                 std::function<void(const std::string&)> log);
  ~BlackBoxWriter() { finish(); }
  BlackBoxWriter(const BlackBoxWriter&) = delete;
  BlackBoxWriter& operator=(const BlackBoxWriter&) = delete;

  /// After the loop's end: writes the remaining stretches, logs what was not kept, joins the thread. May be
  /// called again.
  void finish();
  [[nodiscard]] BlackBoxCounts counts() const noexcept;

 private:
  void run();
  void writeAll();

  BlackBox& box_;
  std::filesystem::path folder_;
  std::string session_;
  std::function<void(const std::string&)> log_;
  std::vector<BlackBoxTick> ticks_;  // the writing thread's own
  std::atomic<std::uint64_t> files_{0}, not_written_{0};
  std::atomic<bool> finish_{false};
  std::thread thread_;
};

/// Removes black boxes that are older than `age_s` and returns how many. Files that cannot be removed stay.
std::size_t removeOldBlackBoxes(const std::filesystem::path& folder, std::int64_t age_s);

}  // namespace needlelab

/// The last 2 s of the haptic loop, kept when something goes wrong (STYLE: black box).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "client/station/run/black_box_tick.h"
#include "common/base/wait_free.h"

namespace needlelab {

/// A ring of ticks, made once. A trigger marks the 2 s before and the 50 ms after it (further triggers in
/// that time make it longer, up to 0.5 s); the stretch is then offered to the reader, and the loop goes on
/// writing into the rest of the ring, which holds another second. What the reader did not copy by then stays
/// whole: new ticks are refused, and counted. Thread: `next`, `commit`, `trigger`, `finish` by the haptic
/// thread, real-time safe; `take` by one reader; the counts by any.
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
  /// Triggers of which nothing is kept: `max_dumps` were there already.
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

/// Tells when so many ticks are missed that it is worth a look: more than 20 ms of them, at once or bit by
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

}  // namespace needlelab

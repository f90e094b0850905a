#include "client/station/run/black_box.h"

#include "client/station/run/ticks_in.h"

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

constexpr double kBefore_s = 2, kAfter_s = 0.05, kLongestAfter_s = 0.5;
constexpr double kSpare_s = 1;  // what the ring holds beyond a stretch while the reader copies it

// one thread writes it: no atomic increment is needed
void countUp(std::atomic<std::uint64_t>& counter) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

}  // namespace

BlackBox::BlackBox(double rate_hz, std::uint32_t max_dumps)
    : before_(ticksIn(kBefore_s, rate_hz)),
      after_(ticksIn(kAfter_s, rate_hz)),
      longest_after_(ticksIn(kLongestAfter_s, rate_hz)),
      max_dumps_(std::clamp(max_dumps, 1u, kMostDumps)),
      ring_(before_ + longest_after_ + ticksIn(kSpare_s, rate_hz)) {}

// would the next tick be written over one that the reader has yet to copy?
bool BlackBox::full() noexcept {
  const std::uint32_t taken = taken_.load(std::memory_order_acquire);
  if (taken == offered_) return false;
  // stretches are offered in order, so the oldest of those left begins first
  return written_ - firsts_[taken] >= ring_.size();
}

BlackBoxTick& BlackBox::next() noexcept {
  refused_last_ = full();
  return refused_last_ ? nowhere_ : ring_[written_ % ring_.size()];
}

void BlackBox::commit() noexcept {
  if (refused_last_) {
    countUp(refused_);
    return;
  }
  ++written_;
  if (open_ && written_ >= ends_at_) offer();
}

void BlackBox::trigger(BlackBoxCause cause, Fault fault, std::uint64_t tick) noexcept {
  countUp(triggers_);
  if (open_) {
    ++dump_.triggers;
    ends_at_ = std::min(written_ + 1 + after_, opened_at_ + 1 + longest_after_);
    return;
  }
  if (offered_ == max_dumps_) {
    countUp(not_kept_);
    return;
  }
  open_ = true;
  opened_at_ = written_;
  ends_at_ = written_ + 1 + after_;
  dump_ = {offered_ + 1, cause, fault, tick, 1, written_ - std::min(written_, before_), 0};
}

void BlackBox::offer() noexcept {
  open_ = false;
  dump_.count = written_ - dump_.first;
  firsts_[offered_++] = dump_.first;
  dumps_.push(dump_);  // never full: there are no more stretches than places
}

void BlackBox::finish() noexcept {
  if (open_) offer();
}

bool BlackBox::take(BlackBoxDump& dump, std::vector<BlackBoxTick>& ticks) {
  if (!dumps_.pop(dump)) return false;
  ticks.clear();
  ticks.reserve(dump.count);
  for (std::uint64_t n = dump.first; n < dump.first + dump.count; ++n)
    ticks.push_back(ring_[n % ring_.size()]);
  // from here on the loop may write over them
  taken_.store(taken_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  return true;
}

}  // namespace needlelab

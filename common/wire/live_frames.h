/// Live frames that wait for one receiver: newest first in worth, so the oldest are dropped and counted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "common/wire/framing.h"

namespace needlelab {

/// Bounded by age and by bytes. A push never fails and never waits: a slow receiver loses its own oldest
/// frames only. Times are of the steady clock (ns) and come from the caller, so that tests choose them.
/// Thread: one.
class LiveQueue {
 public:
  struct Item {
    Frame frame;
    bool counted = false;  ///< a LiveFrame: its loss is told to the receiver (dropped_for_you)
    std::int64_t pushed_ns = 0;
  };

  LiveQueue(std::int64_t max_age_ns, std::size_t max_bytes)
      : max_age_ns_(max_age_ns), max_bytes_(max_bytes) {}

  void push(Frame frame, bool counted, std::int64_t now_ns);
  /// The oldest frame that is young enough.
  std::optional<Item> pop(std::int64_t now_ns);

  [[nodiscard]] bool empty() const { return items_.empty(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// Counted frames dropped so far.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  /// Other frames (status lines) dropped so far.
  [[nodiscard]] std::uint64_t droppedStatus() const { return dropped_status_; }
  void clear();

 private:
  void dropOldest();
  void dropOverAged(std::int64_t now_ns);

  std::int64_t max_age_ns_;
  std::size_t max_bytes_;
  std::deque<Item> items_;
  std::size_t bytes_ = 0;
  std::uint64_t dropped_ = 0, dropped_status_ = 0;
};

}  // namespace needlelab

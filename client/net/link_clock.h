/// The time of a link to the server, and its waits among asio's other work.
#pragma once

#include <chrono>
#include <cstdint>

#include "common/base/time_source.h"
#include "common/wire/asio.h"

namespace needlelab {

/// What a link waits for. Tests tell them apart.
enum class LinkWait : std::uint8_t {
  kRetry,    ///< the back-off's wait before the next attempt, or for an owner's word
  kRequest,  ///< until requests have waited too long, or the reading goes on
  kConnect,  ///< the limit of a look-up and of TCP's connection
  kStatus,   ///< until the next status line
  kEnd,      ///< the limit of the last messages
};

/// Tests derive from it. The limits of an established connection are the channel's own
/// (common/wire/channel.h).
class LinkClock {
 public:
  /// `time` must outlive it.
  explicit LinkClock(TimeSource& time = machineTime()) : time_(time) {}
  virtual ~LinkClock() = default;
  [[nodiscard]] TimeSource& time() const { return time_; }
  [[nodiscard]] std::int64_t steadyNs() const { return time_.nowNs(); }
  [[nodiscard]] virtual std::int64_t unixNs() const;
  /// Waits for `time`, or until `timer` is cancelled.
  virtual Task<> wait(asio::steady_timer& timer, std::chrono::milliseconds time, LinkWait what);
  /// Runs one handler of `io`, which no thread runs: waits for it at most until steadyNs() is `due_ns`. May
  /// return early.
  virtual void runOne(asio::io_context& io, std::int64_t due_ns);

 private:
  TimeSource& time_;
};

}  // namespace needlelab

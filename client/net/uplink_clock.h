/// The offset between the server's steady clock and ours, from several probes: the least round trip wins
/// (DESIGN §6).
#pragma once

#include <cstdint>
#include <optional>

namespace needlelab {

/// For one connection: another server, or the same one restarted, has another clock. Thread: one.
class ClockProbe {
 public:
  struct Estimate {
    std::int64_t offset_ns = 0;  ///< server's clock minus ours; off by at most half the round trip
    std::int64_t round_trip_ns = 0;
  };

  /// A Pong: when we sent, what the server's clock showed, when the answer came. Answers that come before
  /// they were asked for are not believed. True when the estimate got better.
  bool add(std::int64_t sent_ns, std::int64_t server_ns, std::int64_t received_ns) {
    const std::int64_t round_trip_ns = received_ns - sent_ns;
    if (round_trip_ns < 0 || (best_ && round_trip_ns >= best_->round_trip_ns)) return false;
    best_ = Estimate{server_ns - (sent_ns + round_trip_ns / 2), round_trip_ns};
    return true;
  }
  [[nodiscard]] const std::optional<Estimate>& best() const { return best_; }

 private:
  std::optional<Estimate> best_;
};

}  // namespace needlelab

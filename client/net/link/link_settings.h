/// What a ServerLink's owner chooses and hears: the waits between attempts to connect, how requests are
/// treated when the connection is lost, handlers.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "client/net/link/connect.h"
#include "common/base/result.h"
#include "needlelab/control.pb.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// When the link retries after a LinkEnd.
enum class Retry : std::uint8_t {
  kBackOff,  ///< after the back-off's wait
  kProbe,    ///< after the back-off's wait, at most Backoff::Settings::probe: for an address that accepts no
             ///< connections, while the server is needed soon
  kSlowly,   ///< after the back-off's longest wait
  kNever,    ///< not before retryNow() or logIn()
};

/// The waits between attempts to connect: exponential with jitter, so that a thousand stations do not
/// reconnect at the same instant when their server restarts. Deterministic for a seed. Thread: one.
class Backoff {
 public:
  struct Settings {
    std::chrono::milliseconds first{200};
    std::chrono::milliseconds most{10'000};
    double factor = 2.0;
    /// The longest wait between probes. A shorter one finds the server sooner after an outage, but then more
    /// stations shake hands in its first second: N stations cause N / (0.75 · probe).
    std::chrono::milliseconds probe{1500};
  };

  Backoff(std::uint64_t seed, Settings settings) : settings_(settings), random_(seed) {}
  explicit Backoff(std::uint64_t seed) : Backoff(seed, Settings{}) {}

  /// Uniform in [d/2, d], d = min(most, first·factor^n) for the n-th call since the last reset.
  std::chrono::milliseconds next() { return next(settings_.most); }
  std::chrono::milliseconds next(std::chrono::milliseconds most);
  /// Likewise with `probe` instead of `most`. A probe that waits `probe` does not count as a call, so a busy
  /// server found after a long outage is retried soon.
  std::chrono::milliseconds nextProbe();
  /// Call after a success.
  void reset() { tries_ = 0; }
  [[nodiscard]] std::uint32_t tries() const { return tries_; }

 private:
  std::chrono::milliseconds jittered(double wait_ms);
  [[nodiscard]] double grown() const;  // ms

  Settings settings_;
  std::mt19937_64 random_;
  std::uint32_t tries_ = 0;
};

/// The offset between the server's steady clock and ours, estimated from several Pings; the shortest round
/// trip wins. Use one per connection, because another server, or the same one after a restart, has a
/// different clock. Thread: one.
class ClockProbe {
 public:
  struct Estimate {
    std::int64_t offset_ns = 0;  ///< server's clock minus ours; off by at most half the round trip
    std::int64_t round_trip_ns = 0;
  };

  /// Adds a Pong: our time of sending, the server's clock, our time of receipt. Ignores a Pong received
  /// before its Ping was sent. Returns true if the estimate improved.
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

inline double Backoff::grown() const {
  return static_cast<double>(settings_.first.count()) * std::pow(settings_.factor, std::min(tries_, 1000u));
}

inline std::chrono::milliseconds Backoff::jittered(double wait_ms) {
  // makes a number in [0, 1) from 53 random bits: std's distributions differ between libraries
  const double u = static_cast<double>(random_() >> 11) * 0x1p-53;
  return std::chrono::milliseconds(static_cast<std::int64_t>(wait_ms * (0.5 + 0.5 * u)));
}

inline std::chrono::milliseconds Backoff::next(std::chrono::milliseconds most) {
  const double wait_ms = std::min(static_cast<double>(std::min(most, settings_.most).count()), grown());
  ++tries_;
  return jittered(wait_ms);
}

inline std::chrono::milliseconds Backoff::nextProbe() {
  const auto longest = static_cast<double>(std::min(settings_.probe, settings_.most).count());
  if (grown() >= longest) return jittered(longest);
  return next();
}

struct LinkSettings {
  Backoff::Settings retry{};
  /// Only a connection that lasted longer than this counts as a success and resets the waits. Otherwise two
  /// stations with the same key would disconnect each other five times a second.
  std::chrono::milliseconds lasting = retry.most;
  /// Used instead with several servers if the server gave no reason: when servers die one after the other,
  /// the next one should be tried without a wait. Two stations with the same key get a reason.
  std::chrono::milliseconds lasting_of_several{2'000};
  /// Used instead of retry.most with several servers: if all fail, the cause is usually their database, and
  /// ends for all at once. Meanwhile N stations cause N / (0.75 · this) log-ins per second.
  std::chrono::milliseconds max_of_several{4'000};
  std::size_t max_waiting = 256;  ///< requests without a reply
  std::uint64_t seed = 0;         ///< for jitter and random order; 0: from the clocks
  bool reconnects = true;         ///< false: only after reconnect(true)
  std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>();
};

/// Why the link has no connection.
struct LinkEnd {
  bool was_connected = false;     ///< a connection was lost; false: no server accepted us in one round
  bool reached = false;           ///< TCP connected; false: no address accepts connections
  bool is_server_reason = false;  ///< `error` is the server's own reason: a fatal Refusal, or a Bye
  bool stopping = false;          ///< by stop(): the link does not reconnect
  bool others = false;            ///< for a lost connection: another server may accept us
  Error error;                    ///< with several servers: the error of each, unless one refused us
  std::string server;             ///< HOST:PORT that was lost or refused us; otherwise the whole list
  std::string channel_text;       ///< how the channel of a lost connection was closed
  std::int64_t next_try_ns = 0;   ///< steady clock; 0: the link does not retry by itself
};

/// Treatment of a request when the connection is lost before its reply.
enum class OnLoss : std::uint8_t {
  kResend,  ///< the link sends it again on the next connection: for requests that only read
  kGiveUp,  ///< kUnavailable: the server may or may not have executed it. Without a connection: fails at once
};

/// Handlers run on the link's thread; each may be empty.
struct LinkHandlers {
  /// The owner's check of this server and role; an error counts as a refused log-in, at every server.
  std::function<Status(const pb::Welcome&)> accept;
  std::function<void(const pb::Welcome&)> connected;
  /// Receives every message except Pings and the replies to `ask`. A Bye arrives here before the link closes.
  std::function<void(pb::Envelope&)> message;
  /// Called before `away`. Empty: always kBackOff.
  std::function<Retry(const LinkEnd&)> judge;
  std::function<void(const LinkEnd&)> away;
};

using LinkAnswer = std::function<void(Result<pb::Reply>)>;
inline constexpr std::chrono::milliseconds kLinkForever{std::numeric_limits<std::int64_t>::max() / 4'000'000};

}  // namespace needlelab

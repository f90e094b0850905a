/// The one link of a client program to its server: it connects, logs in, comes back after a loss, and matches
/// replies to requests. The station's uplink, the instructor, the commands (BlockingClient) and the load and
/// herd programs are all built on it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>

#include "client/net/connect.h"
#include "common/base/result.h"
#include "needlelab/control.pb.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// The waits between attempts to connect: exponential with jitter, so that a thousand stations
/// whose server restarts do not come back at the same instant. Deterministic for a seed. Thread: one.
class Backoff {
 public:
  struct Settings {
    std::chrono::milliseconds first{200};
    std::chrono::milliseconds most{10'000};
    double factor = 2.0;
  };

  Backoff(std::uint64_t seed, Settings settings) : settings_(settings), random_(seed) {}
  explicit Backoff(std::uint64_t seed) : Backoff(seed, Settings{}) {}

  /// Uniform in [d/2, d], d = min(most, first·factor^n) for the n-th call since the last reset.
  std::chrono::milliseconds next();
  /// After a success.
  void reset() { tries_ = 0; }
  [[nodiscard]] std::uint32_t tries() const { return tries_; }

 private:
  Settings settings_;
  std::mt19937_64 random_;
  std::uint32_t tries_ = 0;
};

/// The offset between the server's steady clock and ours, from several Pings: the least round trip wins.
/// For one connection: another server, or the same one restarted, has another clock. Thread: one.
class ClockProbe {
 public:
  struct Estimate {
    std::int64_t offset_ns = 0;  ///< server's clock minus ours; off by at most half the round trip
    std::int64_t round_trip_ns = 0;
  };

  /// A Pong: when we sent, what the server's clock showed, when the answer came. Answers that come before
  /// their question are not believed. True when the estimate got better.
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

/// The time that a link goes by. Tests bring their own.
class LinkClock {
 public:
  virtual ~LinkClock() = default;
  [[nodiscard]] virtual std::int64_t steadyNs() const;
  [[nodiscard]] virtual std::int64_t unixNs() const;
  /// Waits for `time`, or until `timer` is cancelled.
  virtual Task<> wait(asio::steady_timer& timer, std::chrono::milliseconds time);
};

struct LinkSettings {
  Backoff::Settings retry{};
  /// Only a connection that lasted longer than this is a success, after which the waits begin with the
  /// shortest one: two stations with one key would otherwise throw each other out five times a second.
  std::chrono::milliseconds lasting = retry.most;
  std::size_t most_waiting = 256;  ///< requests without a reply
  std::uint64_t seed = 0;          ///< of the jitter; 0: from the clocks
  bool reconnects = true;          ///< false: only when reconnect(true) says so
  std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>();
};

/// Why the link has no connection.
struct LinkEnd {
  bool was_connected = false;   ///< a connection was lost; false: none could be made
  bool said_by_server = false;  ///< `error` is the server's own reason: a fatal Refusal, or a Bye
  bool stopping = false;        ///< by stop(): the link does not come back
  Error error;
  std::string channel_text;      ///< of a lost connection: how its channel was closed
  std::int64_t next_try_ns = 0;  ///< steady clock; 0: the link does not try again by itself
};

/// When the link tries again after a LinkEnd.
enum class Retry : std::uint8_t {
  kBackOff,  ///< after a wait of the back-off
  kSlowly,   ///< after the longest wait of the back-off
  kNever,    ///< not before retryNow() or logIn()
};

/// Treatment of a request whose connection is lost before its reply came.
enum class OnLoss : std::uint8_t {
  kAskAgain,  ///< it is sent again on the next connection: for what only reads
  kGiveUp,    ///< kUnavailable: it may or may not have happened. While there is no connection: at once
};

/// Called on the link's thread; each may be empty.
struct LinkHandlers {
  /// Whether the owner wants this server and role; an error is treated as a refused log-in.
  std::function<Status(const pb::Welcome&)> accept;
  std::function<void(const pb::Welcome&)> connected;
  /// Every message but Pings and the replies to `ask`. A Bye is handed over before the link closes.
  std::function<void(pb::Envelope&)> message;
  /// Before `away`. Empty: always kBackOff.
  std::function<Retry(const LinkEnd&)> judge;
  std::function<void(const LinkEnd&)> away;
};

/// Thread: all of it on the io_context's, which is one. The link may be destroyed at any time outside of its
/// handlers: it cuts its connection then, and calls no handler any more.
class ServerLink {
 public:
  using Answer = std::function<void(Result<pb::Reply>)>;
  static constexpr std::chrono::milliseconds kForever{std::numeric_limits<std::int64_t>::max() / 4'000'000};

  ServerLink(asio::io_context& io, LinkSettings settings, LinkHandlers handlers);
  ~ServerLink();
  ServerLink(const ServerLink&) = delete;
  ServerLink& operator=(const ServerLink&) = delete;

  /// Connects with this log-in in place of any before. A person's password is needed once: reconnections use
  /// the token of the last Welcome while it is valid, and the password when the server refuses the token.
  void logIn(ClientConfig config);
  /// Ends the connection with a Bye; requests that wait end with kUnavailable.
  void logOut(const std::string& reason);
  /// Does not wait for the next attempt.
  void retryNow();
  /// Whether a lost connection is made again.
  void reconnect(bool wanted);
  /// Says Bye, sends what is queued and closes, within the channel's close_grace; requests that wait end with
  /// kFailed. `done` is called when the connection is gone, or at once without one.
  void stop(const std::string& reason, std::function<void()> done = {});

  /// Sends the request (its id is set here) now or on the next connection and hands over its reply. Errors:
  /// errorOf(Refusal); kUnavailable after `patience`, after a loss (`on_loss`), or when too many wait;
  /// kFailed at the end of the link. Returns the request's id.
  std::uint64_t ask(pb::Request request, Answer answer, OnLoss on_loss = OnLoss::kAskAgain,
                    std::chrono::milliseconds patience = std::chrono::seconds(60));
  /// The answer of this request is not wanted any more.
  void forget(std::uint64_t id);

  /// False: there is no connection now.
  bool send(const pb::Envelope& envelope);
  /// A live message: dropped when the network is too slow for it. See Channel::sendLive.
  void sendLive(Frame frame, bool counted);
  /// Sends what is queued and closes; the link connects again.
  void drop(CloseReason reason, const std::string& text);
  /// Cuts the connection now; the link connects again.
  void cut(const std::string& text);
  /// Reads nothing for so long, beginning with the next message.
  void pauseReading(std::chrono::milliseconds time);

  [[nodiscard]] bool online() const;
  [[nodiscard]] const pb::Welcome& welcome() const;  ///< of the last connection
  [[nodiscard]] std::uint64_t connections() const;   ///< made so far
  [[nodiscard]] std::size_t waiting() const;         ///< requests without a reply
  [[nodiscard]] std::size_t queuedBytes() const;     ///< unsent control messages
  /// Why the connection ends or has ended, as far as it is known; only while not online().
  [[nodiscard]] Error endError() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace needlelab

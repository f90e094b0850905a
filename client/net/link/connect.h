/// Makes an authenticated connection to an address: connect, TLS, Hello, Login, Welcome. ServerLink repeats
/// it after each loss. Both use LinkClock.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/base/time/time_source.h"
#include "common/wire/asio.h"
#include "common/wire/channel.h"
#include "common/wire/endpoint.h"
#include "common/wire/protocol.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// For programs that connect once and then end or report a failure. Longer than the server's limit
/// (ChannelLimits::handshake_timeout), so that a busy server answers or itself reports that it gives up.
/// Programs that retry use a shorter limit.
inline constexpr std::chrono::milliseconds kConnectOnceTimeout{15'000};
static_assert(kConnectOnceTimeout > ChannelLimits{}.handshake_timeout);

/// Limits for one of several servers or addresses, so that it does not keep us from the others: for TCP (a
/// lost SYN is repeated after 1 s), and for TCP, TLS and log-in together. ClientConfig's own limits also
/// apply.
inline constexpr std::chrono::milliseconds kReachOneOfSeveral{1'500};
inline constexpr std::chrono::milliseconds kConnectOneOfSeveral{5'000};

/// The purpose of a link's wait, for tests.
enum class LinkWait : std::uint8_t {
  kRetry,    ///< the back-off before the next attempt, or until the owner calls
  kRequest,  ///< until a request times out or reading resumes
  kConnect,  ///< the time limit for look-up and TCP
  kStatus,   ///< until the next status line
  kEnd,      ///< the time limit for the last messages
};

/// The time of a link to the server, and its waits among asio's other work. Tests derive from it. The channel
/// itself limits an established connection (common/wire/channel.h).
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
  /// Runs one handler of `io`, which no other thread runs. Waits for it until steadyNs() is `due_ns` at most.
  /// May return early.
  virtual void runOne(asio::io_context& io, std::int64_t due_ns);

 private:
  TimeSource& time_;
};

struct ClientConfig {
  Endpoint server;
  Endpoints others;               ///< equivalent servers; used by ServerLink, but not by connectClient
  std::filesystem::path ca_file;  ///< the server's tls/ca.crt; not read if `tls` is given
  TlsContext tls;                 ///< optional, shared by many connections of one program
  std::string program;            ///< e.g. programText("station")
  pb::Login login;
  std::chrono::milliseconds connect_timeout{5000};  ///< for look-up, TCP, TLS and log-in together
  std::chrono::milliseconds reach_timeout{5000};    ///< for look-up and TCP only; within connect_timeout
  ChannelLimits limits;
  pb::Version version = ourVersion();  ///< tests set another

  /// `all` is not empty; its first becomes `server`.
  void setServers(const Endpoints& all);
  [[nodiscard]] Endpoints servers() const;
};

/// Log-ins, ready for ClientConfig.
pb::Login stationLogin(const std::string& station, const std::string& key);
pb::Login personLogin(const std::string& user, const std::string& password);

/// The result of connectClient.
struct ClientConnection {
  std::shared_ptr<Channel> channel;  ///< started; frame limit 1 MiB
  pb::Welcome welcome;
  pb::Hello server;
};

/// Part of kDenied's message if the server's certificate does not cover the name that we connected to.
inline constexpr const char* kNotForThisName = "its certificate is not for the name";

/// One call of connectClient, for callers that make several.
struct ConnectTry {
  /// Chooses one of the server's addresses (at least one). Empty: all are tried in turn.
  std::function<asio::ip::address(const std::vector<asio::ip::address>&)> choose;
  /// There are other places, so this one is limited to kReachOneOfSeveral (including the look-up) and
  /// kConnectOneOfSeveral. `choose` may set it.
  bool others = false;
  // set by the call
  bool reached = false;  ///< TCP connected; false: the address accepts no connections
  /// Why the server itself refused us; REASON_UNSPECIFIED if it did not.
  pb::Refusal::Reason refused = pb::Refusal::REASON_UNSPECIFIED;
};

/// Connects on the executor of the calling coroutine, which must be single-threaded. `clock` is used until
/// TCP has connected; the rest of connect_timeout is the channel's. `attempt`, if given, must outlive the
/// call. Errors: kInvalidInput (the CA file), kUnavailable (no answer, time-out: retry), kDenied
/// (certificate, log-in), kVersion (both versions in the message), others as errorOf(Refusal).
Task<Result<ClientConnection>> connectClient(ClientConfig config,
                                             std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>(),
                                             ConnectTry* attempt = nullptr);

/// Returns the Pong to a peer's Ping. `now_ns`: our steady clock.
pb::Envelope pongTo(const pb::Ping& ping, std::int64_t now_ns);

}  // namespace needlelab

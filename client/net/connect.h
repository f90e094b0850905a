/// Makes an authenticated connection from an address: connect, TLS, Hello, Login, Welcome. ServerLink repeats
/// it after each loss.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/net/link_clock.h"
#include "common/base/result.h"
#include "common/wire/channel.h"
#include "common/wire/endpoint.h"
#include "common/wire/protocol.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// For programs that connect once and then end, or report a failure to a person: longer than the bound of the
/// server (ChannelLimits::handshake_timeout), so that a busy one answers, or says itself that it gives up.
/// Whoever connects again and again gives up sooner.
inline constexpr std::chrono::milliseconds kConnectOnceTimeout{15'000};
static_assert(kConnectOnceTimeout > ChannelLimits{}.handshake_timeout);

/// Where there are other servers or addresses, no one keeps us from them for longer: for TCP (a SYN that is
/// lost once is sent again after 1 s), and for all of TCP, TLS and log-in. Within ClientConfig's own limits.
inline constexpr std::chrono::milliseconds kReachOneOfSeveral{1'500};
inline constexpr std::chrono::milliseconds kConnectOneOfSeveral{5'000};

struct ClientConfig {
  Endpoint server;
  Endpoints others;  ///< any of these will do as well: a ServerLink goes on there; connectClient does not
  std::filesystem::path ca_file;  ///< the server's tls/ca.crt; not read when `tls` is given
  TlsContext tls;                 ///< optional, shared by many connections of one program
  std::string program;            ///< e.g. programText("station")
  pb::Login login;
  std::chrono::milliseconds connect_timeout{5000};  ///< for the whole of look-up, TCP, TLS and log-in
  std::chrono::milliseconds reach_timeout{5000};    ///< for look-up and TCP alone; within connect_timeout
  ChannelLimits limits;
  pb::Version version = ourVersion();  ///< tests set another

  /// `all` is not empty: the first is `server`.
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

/// Part of kDenied's message when the server's certificate does not cover the name that we connected to.
inline constexpr const char* kNotForThisName = "its certificate is not for the name";

/// One call of connectClient, for who makes several.
struct ConnectTry {
  /// Chooses one of the server's addresses, which are at least one. Empty: all are tried in turn.
  std::function<asio::ip::address(const std::vector<asio::ip::address>&)> choose;
  /// There are other places, so this one gets kReachOneOfSeveral (the look-up, too) and
  /// kConnectOneOfSeveral. `choose` may set it.
  bool others = false;
  // set by the call
  bool reached = false;  ///< TCP connected; false: nobody accepts connections at the address
  /// Why the server itself refused us; REASON_UNSPECIFIED: it did not.
  pb::Refusal::Reason refused = pb::Refusal::REASON_UNSPECIFIED;
};

/// Connects on the executor of the calling coroutine, which must be one thread. `clock` has the time until
/// TCP has connected; what is left of connect_timeout then is the channel's. `attempt`, if given, must
/// outlive the call. Errors: kInvalidInput (the CA file), kUnavailable (no answer, time-out: try again),
/// kDenied (certificate, log-in), kVersion (both versions in the message), others as errorOf(Refusal).
Task<Result<ClientConnection>> connectClient(ClientConfig config,
                                             std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>(),
                                             ConnectTry* attempt = nullptr);

/// Returns the Pong to a peer's Ping. `now_ns`: our steady clock.
pb::Envelope pongTo(const pb::Ping& ping, std::int64_t now_ns);

}  // namespace needlelab

/// Makes an authenticated connection from an address: connect, TLS, Hello, Login, Welcome. ServerLink repeats
/// it after each loss.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

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

struct ClientConfig {
  Endpoint server;
  std::filesystem::path ca_file;  ///< the server's tls/ca.crt; not read when `tls` is given
  TlsContext tls;                 ///< optional, shared by many connections of one program
  std::string program;            ///< e.g. programText("station")
  pb::Login login;
  std::chrono::milliseconds connect_timeout{5000};  ///< for the whole of look-up, TCP, TLS and log-in
  std::chrono::milliseconds reach_timeout{5000};    ///< for look-up and TCP alone; within connect_timeout
  ChannelLimits limits;
  pb::Version version = ourVersion();  ///< tests set another
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

/// Connects on the executor of the calling coroutine, which must be one thread. `clock` has the time until
/// TCP has connected; what is left of connect_timeout then is the channel's. Sets `*reached`, if given, once
/// TCP has connected; it must outlive the call. Errors: kInvalidInput (the CA file), kUnavailable (no answer,
/// time-out: try again), kDenied (certificate, log-in), kVersion (both versions in the message), others as
/// errorOf(Refusal).
Task<Result<ClientConnection>> connectClient(ClientConfig config,
                                             std::shared_ptr<LinkClock> clock = std::make_shared<LinkClock>(),
                                             bool* reached = nullptr);

/// Returns the Pong to a peer's Ping. `now_ns`: our steady clock.
pb::Envelope pongTo(const pb::Ping& ping, std::int64_t now_ns);

}  // namespace needlelab

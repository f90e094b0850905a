/// A connection that comes back: after a loss it is made again with the token of the last log-in, or with the
/// password.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "client/net/backoff.h"
#include "client/net/blocking_client.h"
#include "common/base/result.h"

namespace needlelab {

/// Thread: one.
class ServerLink {
 public:
  using Clock = std::chrono::steady_clock;

  /// `config` without a log-in; the password is kept in memory for later log-ins.
  ServerLink(ClientConfig config, std::string user, std::string password);

  /// Once. Errors: as BlockingClient::connect.
  Status connect();
  /// After a loss: tries again, waiting longer and longer, until it succeeds, `until` comes or `stop` says
  /// so. Errors: the last one; kDenied and kVersion end it at once.
  Status reconnect(Clock::time_point until, const std::function<bool()>& stop);

  /// Only after a success.
  BlockingClient& client() { return *client_; }

 private:
  ClientConfig config_;
  pb::Login by_password_;
  Backoff backoff_;
  std::optional<BlockingClient> client_;
};

}  // namespace needlelab

#include "client/instructor/terminal/server_link.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "common/base/clock.h"

namespace needlelab {

ServerLink::ServerLink(ClientConfig config, std::string user, std::string password)
    : config_(std::move(config)),
      by_password_(personLogin(user, password)),
      backoff_(static_cast<std::uint64_t>(steadyNowNs())) {}

Status ServerLink::connect() {
  config_.login = by_password_;
  if (client_ && !client_->welcome().token().empty() &&
      client_->welcome().token_expires_unix_ns() > wallNowNs()) {
    config_.login.set_token(client_->welcome().token());
  }
  auto connected = BlockingClient::connect(config_);
  if (!connected.ok() && connected.error().code == ErrorCode::kDenied && config_.login.has_token()) {
    // the server started again and knows its old tokens no more
    config_.login = by_password_;
    connected = BlockingClient::connect(config_);
  }
  if (!connected.ok()) return connected.error();
  client_.emplace(std::move(*connected));
  return {};
}

Status ServerLink::reconnect(Clock::time_point until, const std::function<bool()>& stop) {
  Status last = Error{ErrorCode::kUnavailable, "the connection is lost"};
  backoff_.reset();
  for (;;) {
    // short naps, so that Ctrl-C is heard
    const auto next = Clock::now() + backoff_.next();
    while (Clock::now() < next) {
      if (stop() || Clock::now() >= until) return last;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    last = connect();
    if (last.ok() || last.error().code == ErrorCode::kDenied || last.error().code == ErrorCode::kVersion)
      return last;
  }
}

}  // namespace needlelab

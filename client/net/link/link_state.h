/// The state of a ServerLink (server_link.h). Private to this folder.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/net/link/link_settings.h"
#include "client/net/link/server_choice.h"
#include "proto/session_rules.h"

namespace needlelab {

/// The coroutines share the state, so that it lives until they have ended, even after the link.
struct ServerLinkState {
  struct WipeAndDelete {
    void operator()(pb::Request* request) const {
      wipeSecrets(*request);
      delete request;
    }
  };
  struct Waiting {
    std::unique_ptr<pb::Request, WipeAndDelete> request;  // may contain a code or a password
    LinkAnswer answer;
    OnLoss on_loss = OnLoss::kResend;
    std::int64_t until_ns = 0;
  };

  ServerLinkState(asio::io_context& context, LinkSettings chosen, LinkHandlers given);

  static std::int64_t nanoseconds(std::chrono::milliseconds time) {
    return std::chrono::nanoseconds(time).count();
  }
  static Task<> run(std::shared_ptr<ServerLinkState> self);
  static Task<> watchDeadlines(std::shared_ptr<ServerLinkState> self);
  Task<Result<ClientConnection>> connectToAny(LinkEnd& end, std::uint64_t number);
  Task<Result<ClientConnection>> connect(ClientConfig chosen, std::uint64_t number, ConnectTry& attempt);
  Task<> serve(ClientConnection connection);
  Task<> waitForNextTry(LinkEnd& end, std::uint64_t number);
  void take(pb::Envelope envelope);
  void answer(std::uint64_t id, Result<pb::Reply> reply);
  void sendRequest(std::uint64_t id, const Waiting& one);
  template <typename Which>
  void fail(const Error& error, Which which);
  [[nodiscard]] bool online() const { return channel && !channel->closing() && !server_reason; }

  asio::io_context& io;
  LinkSettings settings;
  LinkHandlers handlers;
  const std::uint64_t seed;
  Backoff backoff;
  bool reconnects;
  bool probing = false;        // the next attempt follows a Retry::kProbe
  asio::steady_timer nap{io};  // run() waits on it; cancelled on each change
  std::optional<ClientConfig> config;
  std::shared_ptr<ServerChoice> choice;  // for `config`
  Endpoint server;                       // of the last connection
  std::string passed_over;
  std::uint64_t login_number = 0;  // counts log-ins and log-outs
  std::string token;
  std::int64_t token_until_unix_ns = 0;

  std::shared_ptr<Channel> channel;  // while connected
  pb::Welcome welcome;
  std::uint64_t connections = 0;
  std::optional<Error> server_reason;  // the server's reason for ending the connection
  std::optional<Error> ended;          // the last connection's end
  std::chrono::milliseconds read_pause{0};

  std::map<std::uint64_t, Waiting> waiting;
  std::uint64_t next_request = 1;
  bool watching_deadlines = false;

  bool stopping = false, abandoned = false, running = true;
  std::function<void()> stopped;
};

template <typename Which>
void ServerLinkState::fail(const Error& error, Which which) {
  std::vector<LinkAnswer> failed;
  for (auto it = waiting.begin(); it != waiting.end();) {
    if (!which(it->second)) {
      ++it;
      continue;
    }
    failed.push_back(std::move(it->second.answer));
    it = waiting.erase(it);
  }
  // after the loop, because an answer may call `ask`
  for (const LinkAnswer& each : failed)
    if (each && !abandoned) each(error);
}

}  // namespace needlelab

/// What the connections of one server share, without its ports, for a test that runs the network's loop
/// itself.
#pragma once

#include "server/live/port/server_state.h"

namespace needlelab::test {

/// The pools of a bare context. A test that does not care about threads passes the same one four times.
struct BarePools {
  asio::thread_pool& workers;
  asio::thread_pool& closers;
  asio::thread_pool& views;
  asio::thread_pool& others;
};

/// There is one handshake turn. Loop, store and pools must outlive it.
class BareServer {
 public:
  BareServer(asio::io_context& io, Store& store, const BarePools& pools)
      : state_{.store = store,
               .work = {.io = io,
                        .passwords = pools.others,
                        .logins = pools.others,
                        .parsers = pools.others,
                        .workers = pools.workers,
                        .closers = pools.closers,
                        .views = pools.views,
                        .slow_workers = pools.others,
                        .retention_workers = pools.others},
               .limits = {.io = io,
                          .bounds = {},
                          .handshakes = HandshakeTurns(HandshakeTurns::Settings{.at_once = 1})}} {
    state_.logins.state = std::make_unique<LoginsInMemory>(
        [&store](const Principal& who) { return store.service().logins().stillAllowed(who); }, LoginGuard(),
        Tokens());
  }
  [[nodiscard]] ServerContext& context() { return state_.context; }

 private:
  ServerState state_;
};

}  // namespace needlelab::test

/// What the connections of one server share, without its ports, for a test that runs the network's loop
/// itself.
#pragma once

#include "server/live/context.h"

namespace needlelab::test {

/// The pools of a bare context. A test that does not look at threads gives the same one four times.
struct BarePools {
  asio::thread_pool& workers;
  asio::thread_pool& closers;
  asio::thread_pool& views;
  asio::thread_pool& others;
};

/// Handshakes have one turn. Loop, store and pools outlive the context.
inline ServerContext bareContext(asio::io_context& io, Store& store, const BarePools& pools) {
  return {.io = io,
          .store = store,
          .passwords = pools.others,
          .logins = pools.others,
          .parsers = pools.others,
          .workers = pools.workers,
          .closers = pools.closers,
          .views = pools.views,
          .slow_workers = pools.others,
          .retention_workers = pools.others,
          .bounds = {},
          .hub = Hub(),
          .login = std::make_unique<LoginsInMemory>(
              [&store](const Principal& who) { return store.service().stillAllowed(who); }, LoginGuard(),
              Tokens()),
          .counters = {},
          .handshakes = HandshakeTurns(HandshakeTurns::Settings{.at_once = 1}),
          .connections = {}};
}

}  // namespace needlelab::test

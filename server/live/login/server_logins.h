/// Log-ins of one server: their state, the queue for password checks, and concurrent access changes.
#pragma once

#include <memory>

#include "common/wire/asio.h"
#include "server/live/limits/limits.h"
#include "server/live/login/access_changes.h"
#include "server/live/login/login_state.h"
#include "server/live/work/turn_queue.h"

namespace needlelab {

struct ServerLogins {
  asio::io_context& io;
  const LoginQueueLimits& bounds;
  std::unique_ptr<LoginState> state{};  ///< lock-outs and tokens
  LoginQueue waiting{io.get_executor(), bounds};
  AccessChanges access{};  ///< accounts disabled, keys revoked, passwords changed
};

}  // namespace needlelab

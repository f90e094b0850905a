/// Communication between systemd and this service: passed sockets and the service's state. Does not need
/// libsystemd; without systemd (its variables are absent) every function does nothing. Thread: any.
#pragma once

#include <chrono>
#include <optional>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Returns the listening stream sockets that systemd opened for this process (sd_listen_fds(3)). LISTEN_PID
/// must be this process; descriptors begin at 3. Sets FD_CLOEXEC and removes the variables: call it once,
/// before starting threads. Error if one of them is not a listening stream socket.
Result<std::vector<int>> takeListenSockets();

/// sd_notify(3): sends "READY=1", "STOPPING=1", "WATCHDOG=1", "STATUS=…" to $NOTIFY_SOCKET. False when the
/// socket does not exist or did not accept the message.
bool notifyManager(std::string_view state);

/// Interval for "WATCHDOG=1": half of WATCHDOG_USEC, as sd_watchdog_enabled(3) advises; nothing when the
/// manager has no watchdog for this service.
std::optional<std::chrono::microseconds> watchdogPeriod();

}  // namespace needlelab

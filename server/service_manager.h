/// The messages between systemd and a service: sockets that are handed over, and the state of the service.
/// Nothing of it needs libsystemd; without systemd (no such variables) every function does nothing. Thread:
/// any.
#pragma once

#include <chrono>
#include <optional>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Listening stream sockets that systemd opened for this process (sd_listen_fds(3)): LISTEN_PID must be ours;
/// the files begin at 3. They get FD_CLOEXEC, and the variables are removed: call it once, before threads. An
/// error when a file among them is not a listening stream socket.
Result<std::vector<int>> takeListenSockets();

/// sd_notify(3): "READY=1", "STOPPING=1", "WATCHDOG=1", "STATUS=…", to $NOTIFY_SOCKET. False when there is
/// none or it did not take the message.
bool notifyManager(std::string_view state);

/// How often "WATCHDOG=1" is due: half of WATCHDOG_USEC, as sd_watchdog_enabled(3) advises; nothing when the
/// manager does not ask for it.
std::optional<std::chrono::microseconds> watchdogPeriod();

}  // namespace needlelab

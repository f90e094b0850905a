/// Listening sockets, and the server's host names.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

/// Resolves HOST:PORT to an address of this machine. Errors: kInvalidInput, naming the option.
Result<Tcp::endpoint> resolveListen(const std::string& text, const std::string& option = "--listen");

/// Errors: kUnavailable, with the process that holds the port, or another reason.
Result<Tcp::acceptor> listenOn(asio::io_context& io, const Tcp::endpoint& endpoint, const std::string& text,
                               const std::string& option = "--listen");

/// Takes over the listening socket `fd` from systemd (service_manager.h). kInvalidInput: not a TCP socket.
Result<Tcp::acceptor> listenOnHandedOver(asio::io_context& io, int fd);

/// Passes each new connection to `accepted` until the acceptor is closed. Logs a failure (e.g. no file
/// descriptors left) as `event` and tries again. The acceptor must outlive it.
Task<> acceptLoop(Tcp::acceptor& acceptor, std::string event, std::function<void(Tcp::socket)> accepted);

/// localhost, 127.0.0.1, ::1, this machine's name, the host of `listen` unless it is a wildcard, and `more`.
std::vector<std::string> certificateHosts(const std::string& listen, const std::vector<std::string>& more);

}  // namespace needlelab

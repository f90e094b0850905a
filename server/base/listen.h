/// Listening on a port, and the names by which the server may be called.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

/// HOST:PORT to an address of this machine. Errors: kInvalidInput, naming the option.
Result<Tcp::endpoint> resolveListen(const std::string& text, const std::string& option = "--listen");

/// Errors: kUnavailable, saying that the port is taken and by whom, or why else.
Result<Tcp::acceptor> listenOn(asio::io_context& io, const Tcp::endpoint& endpoint, const std::string& text,
                               const std::string& option = "--listen");

/// A listening socket from systemd (service_manager.h); it takes `fd` over. kInvalidInput: no TCP socket.
Result<Tcp::acceptor> listenOnHandedOver(asio::io_context& io, int fd);

/// Hands each connection that arrives to `accepted`, until the acceptor is closed. A failure (no file
/// descriptors, say) is logged as `event` and tried again. The acceptor must outlive it.
Task<> acceptLoop(Tcp::acceptor& acceptor, std::string event, std::function<void(Tcp::socket)> accepted);

/// localhost, 127.0.0.1, ::1, this machine's name, the host of `listen` unless it is a wildcard, and `more`.
std::vector<std::string> certificateHosts(const std::string& listen, const std::vector<std::string>& more);

}  // namespace needlelab

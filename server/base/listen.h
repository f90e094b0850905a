/// Listening sockets, and the server's host names.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/asio.h"
#include "common/wire/certificates.h"

namespace needlelab {

/// Resolves HOST:PORT to an address of this machine. Errors: kInvalidInput, naming the option.
Result<Tcp::endpoint> resolveListen(const std::string& text, const std::string& option = "--listen");

/// Errors: kUnavailable, naming the process that holds the port, or another reason.
Result<Tcp::acceptor> listenOn(asio::io_context& io, const Tcp::endpoint& endpoint, const std::string& text,
                               const std::string& option = "--listen");

/// Takes over the listening socket `fd` from systemd (service_manager.h). kInvalidInput: not a TCP socket.
Result<Tcp::acceptor> listenOnHandedOver(asio::io_context& io, int fd);

/// Most unsent bytes of a connection that the kernel accepts (TCP_NOTSENT_LOWAT); some 50 KiB with the last
/// write. If the peer does not read, the rest waits in the program, where ByteBudget counts it. Does not
/// limit what is in flight to a peer that reads.
inline constexpr int kMaxUnsentBytes = 32 << 10;

/// SO_RCVBUF and SO_SNDBUF of a connection. The kernel doubles each (for its bookkeeping): one for what the
/// server has not read, one for what the peer has not acknowledged. So it holds at most 512 KiB per
/// connection. A window of half the memory allows 1.3 MB/s over a path of 100 ms; a station sends some 100
/// kB/s.
inline constexpr int kKernelBufferBytes = 128 << 10;

/// The kernel ends a connection after this time (TCP_USER_TIMEOUT, ms) if the peer acknowledges nothing, or
/// has no room for what waits.
inline constexpr unsigned kMaxUnacknowledgedMs = 30'000;

/// Sets these bounds on a socket. Connections inherit them from the listening socket, as it was when they
/// arrived; their windows can grow up to them.
void boundKernelBytes(int fd);

/// Connections accepted in a row before other sockets are served. Addresses can only be told apart after
/// accept(), so strangers must not keep others in the kernel's queue.
inline constexpr int kAcceptsATurn = 64;

/// Passes each new connection, bounded by boundKernelBytes(), to `accepted` until the acceptor is closed.
/// Logs a failure (e.g. no file descriptors left) as `event` and retries. The acceptor must outlive it.
Task<> acceptLoop(Tcp::acceptor& acceptor, std::string event, std::function<void(Tcp::socket)> accepted);

/// The names for the server's certificate: `hosts`, the host of `listen` unless it is a wildcard, and always
/// localhost, 127.0.0.1, ::1 and this machine's name.
CertificateNames certificateNames(const std::string& listen, std::vector<std::string> hosts,
                                  std::vector<std::string> domains);

}  // namespace needlelab

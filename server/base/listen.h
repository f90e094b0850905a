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

/// Errors: kUnavailable, with the process that holds the port, or another reason.
Result<Tcp::acceptor> listenOn(asio::io_context& io, const Tcp::endpoint& endpoint, const std::string& text,
                               const std::string& option = "--listen");

/// Takes over the listening socket `fd` from systemd (service_manager.h). kInvalidInput: not a TCP socket.
Result<Tcp::acceptor> listenOnHandedOver(asio::io_context& io, int fd);

/// What the kernel takes of a connection's bytes, at most, before they can be sent: some 50 KiB with what it
/// takes at once. The rest of what nobody reads waits in the program, where it is counted (ByteBudget). It is
/// no bound on what is under way to a peer that reads.
inline constexpr int kMostUnsentBytes = 32 << 10;

/// SO_RCVBUF and SO_SNDBUF of a connection: the kernel takes twice as much (with its own bookkeeping) of what
/// the server has not read, and of what the peer has not acknowledged. So it holds 512 KiB of a connection at
/// most. A window of half the memory lets 1.3 MB/s through a path of 100 ms; a station sends some 100 kB/s.
inline constexpr int kKernelBufferBytes = 128 << 10;

/// The kernel ends a connection whose peer has acknowledged nothing of what was sent, or had no room for what
/// waits, for so long (TCP_USER_TIMEOUT, ms).
inline constexpr unsigned kMostUnacknowledgedMs = 30'000;

/// Sets these bounds on a socket. Connections have those of the socket that listens; their windows can grow
/// to what it had when they came.
void boundKernelBytes(int fd);

/// So many waiting connections are accepted before other sockets are looked at again. Only what is accepted
/// can be told apart by its address: strangers must not keep others in the kernel's queue.
inline constexpr int kAcceptsATurn = 64;

/// Passes each new connection, bounded by boundKernelBytes(), to `accepted` until the acceptor is closed.
/// Logs a failure (e.g. no file descriptors left) as `event` and tries again. The acceptor must outlive it.
Task<> acceptLoop(Tcp::acceptor& acceptor, std::string event, std::function<void(Tcp::socket)> accepted);

/// The names for the server's certificate: `hosts` and the host of `listen` unless it is a wildcard; of its
/// own localhost, 127.0.0.1, ::1 and this machine's name.
CertificateNames certificateNames(const std::string& listen, std::vector<std::string> hosts,
                                  std::vector<std::string> domains);

}  // namespace needlelab

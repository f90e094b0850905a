#include "server/live/listen.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>

#include "common/wire/endpoint.h"
#include "server/live/startup.h"

namespace needlelab {

Result<Tcp::endpoint> resolveListen(const std::string& text, const std::string& option) {
  const auto endpoint = parseEndpoint(text);
  if (!endpoint.ok()) return Error{ErrorCode::kInvalidInput, option + " " + endpoint.error().message};
  boost::system::error_code error;
  const auto address = asio::ip::make_address(endpoint->host, error);
  if (!error) return Tcp::endpoint(address, endpoint->port);
  asio::io_context io;
  const auto found = Tcp::resolver(io).resolve(endpoint->host, std::to_string(endpoint->port), error);
  if (error || found.empty()) {
    return Error{ErrorCode::kInvalidInput, option + " '" + text + "': the name '" + endpoint->host +
                                               "' is not known (" + error.message() + ")"};
  }
  return found.begin()->endpoint();
}

Result<Tcp::acceptor> listenOn(asio::io_context& io, const Tcp::endpoint& endpoint, const std::string& text,
                               const std::string& option) {
  Tcp::acceptor acceptor(io);
  boost::system::error_code error;
  acceptor.open(endpoint.protocol(), error);
  // connections of a server that just ended must not keep its successor waiting; a second server is still
  // refused
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (!error) return acceptor;
  if (error == asio::error::address_in_use) {
    const auto holder = portHolder(endpoint.port());
    return Error{ErrorCode::kUnavailable, "cannot listen on " + text + ": the port is taken" +
                                              (holder ? " by " + *holder : "") +
                                              "; is another server running? "
                                              "Choose another with " +
                                              option + " HOST:PORT, or port 0 for any free one"};
  }
  return Error{ErrorCode::kUnavailable, "cannot listen on " + text + ": " + error.message()};
}

Result<Tcp::acceptor> listenOnHandedOver(asio::io_context& io, int fd) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) != 0 ||
      (address.ss_family != AF_INET && address.ss_family != AF_INET6))
    return Error{ErrorCode::kInvalidInput,
                 "the socket that was handed over is no TCP socket: ListenStream=PORT"};
  Tcp::acceptor acceptor(io);
  boost::system::error_code error;
  acceptor.assign(address.ss_family == AF_INET ? Tcp::v4() : Tcp::v6(), fd, error);
  if (error)
    return Error{ErrorCode::kUnavailable, "cannot use the socket that was handed over: " + error.message()};
  return acceptor;
}

std::vector<std::string> certificateHosts(const std::string& listen, const std::vector<std::string>& more) {
  std::vector<std::string> hosts = {"localhost", "127.0.0.1", "::1"};
  const auto add = [&](const std::string& host) {
    if (!host.empty() && std::find(hosts.begin(), hosts.end(), host) == hosts.end()) hosts.push_back(host);
  };
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) == 0) add(name.data());
  if (const auto endpoint = parseEndpoint(listen); endpoint.ok()) {
    boost::system::error_code error;
    const auto address = asio::ip::make_address(endpoint->host, error);
    if (error || !address.is_unspecified()) add(endpoint->host);
  }
  for (const std::string& host : more) add(host);
  return hosts;
}

}  // namespace needlelab

#include "server/base/listen.h"

#include <fmt/core.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

#include "common/base/text/text.h"
#include "common/wire/endpoint.h"
#include "server/base/log.h"

namespace needlelab {
namespace {

/// The inode of the socket that listens on the port, from one of the kernel's tables; empty if there is no
/// such socket.
std::string listeningInode(const char* table, std::uint16_t port) {
  std::ifstream file(table);
  std::string line;
  std::getline(file, line);  // the header line
  const std::string wanted = fmt::format(":{:04X}", port);
  while (std::getline(file, line)) {
    // sl local_address rem_address st tx:rx tr:when retrnsmt uid timeout inode; 0A = LISTEN
    std::istringstream words(line);
    std::array<std::string, 10> field;
    for (std::string& word : field) words >> word;
    if (field[1].ends_with(wanted) && field[3] == "0A") return field[9];
  }
  return {};
}

bool isNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

/// The program that listens on a TCP port of this machine, as "needlelab-server (process 123)", if /proc
/// shows it to this user.
std::optional<std::string> portHolder(std::uint16_t port) {
  std::string inode = listeningInode("/proc/net/tcp", port);
  if (inode.empty()) inode = listeningInode("/proc/net/tcp6", port);
  if (inode.empty() || inode == "0") return std::nullopt;
  const std::string wanted = "socket:[" + inode + "]";
  std::error_code error;
  namespace fs = std::filesystem;
  for (auto at = fs::directory_iterator("/proc", error); !error && at != fs::directory_iterator();
       at.increment(error)) {
    const std::string pid = at->path().filename().string();
    if (!isNumber(pid)) continue;
    // the kernel hides the files of other users' processes: the name stays unknown
    std::error_code hidden;
    for (auto file = fs::directory_iterator(at->path() / "fd", hidden);
         !hidden && file != fs::directory_iterator(); file.increment(hidden)) {
      std::error_code gone;
      if (fs::read_symlink(file->path(), gone).string() != wanted || gone) continue;
      std::ifstream comm(at->path() / "comm");
      std::string name;
      std::getline(comm, name);
      return name + " (process " + pid + ")";
    }
  }
  return std::nullopt;
}

}  // namespace

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
  // lets a new server start while connections of the previous one linger; a second server is still refused
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) boundKernelBytes(acceptor.native_handle());
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
                 "the socket passed by systemd is not a TCP socket: ListenStream=PORT"};
  Tcp::acceptor acceptor(io);
  boost::system::error_code error;
  acceptor.assign(address.ss_family == AF_INET ? Tcp::v4() : Tcp::v6(), fd, error);
  if (error)
    return Error{ErrorCode::kUnavailable, "cannot use the socket that was handed over: " + error.message()};
  boundKernelBytes(fd);
  return acceptor;
}

void boundKernelBytes(int fd) {
  const auto set = [fd](int level, int option, const auto& value) {
    ::setsockopt(fd, level, option, &value, sizeof value);
  };
  set(SOL_SOCKET, SO_RCVBUF, kKernelBufferBytes);
  set(SOL_SOCKET, SO_SNDBUF, kKernelBufferBytes);
  set(IPPROTO_TCP, TCP_NOTSENT_LOWAT, kMaxUnsentBytes);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, kMaxUnacknowledgedMs);
}

Task<> acceptLoop(Tcp::acceptor& acceptor, std::string event, std::function<void(Tcp::socket)> accepted) {
  // otherwise accept() would block if the pending connection was aborted, or without one
  boost::system::error_code error;
  acceptor.non_blocking(true, error);
  acceptor.set_option(asio::socket_base::enable_connection_aborted(true), error);
  while (acceptor.is_open()) {
    auto [failed] = co_await acceptor.async_wait(Tcp::acceptor::wait_read, kUseTuple);
    error = failed;
    for (int count = 0; !error && count < kAcceptsATurn && acceptor.is_open(); ++count) {
      Tcp::socket socket = acceptor.accept(error);
      if (error) break;
      boundKernelBytes(socket.native_handle());  // for arrivals before a handed-over socket was bounded
      accepted(std::move(socket));
    }
    if (!acceptor.is_open()) co_return;
    if (!error || error == asio::error::would_block || error == asio::error::connection_aborted) continue;
    // e.g. no file descriptors left: temporary, and existing connections are unaffected
    logEvent(LogLevel::kError, event, {{"text", error.message()}});
    asio::steady_timer pause(acceptor.get_executor(), std::chrono::milliseconds(100));
    co_await pause.async_wait(kUseTuple);
  }
}

CertificateNames certificateNames(const std::string& listen, std::vector<std::string> hosts,
                                  std::vector<std::string> domains) {
  CertificateNames names{std::move(hosts), {"localhost", "127.0.0.1", "::1"}, std::move(domains)};
  const auto add = [&](std::vector<std::string>& to, const std::string& host) {
    const auto has = [&](const std::vector<std::string>& list) {
      return std::find(list.begin(), list.end(), host) != list.end();
    };
    if (!host.empty() && !has(names.hosts) && !has(names.own)) to.push_back(host);
  };
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) == 0) add(names.own, name.data());
  if (const auto endpoint = parseEndpoint(listen); endpoint.ok()) {
    boost::system::error_code error;
    const auto address = asio::ip::make_address(endpoint->host, error);
    if (error || !address.is_unspecified()) add(names.hosts, endpoint->host);
  }
  return names;
}

}  // namespace needlelab

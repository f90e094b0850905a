#include "server/service_manager.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>

namespace needlelab {
namespace {

constexpr int kFirstFile = 3;  // SD_LISTEN_FDS_START

std::optional<long long> numberIn(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr) return std::nullopt;
  long long number = 0;
  const char* const end = text + std::strlen(text);
  const auto [at, error] = std::from_chars(text, end, number);
  if (error != std::errc() || at != end) return std::nullopt;
  return number;
}

bool isListening(int fd) {
  int type = 0, listening = 0;
  socklen_t size = sizeof type;
  if (::getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_STREAM) return false;
  size = sizeof listening;
  return ::getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listening, &size) == 0 && listening != 0;
}

}  // namespace

Result<std::vector<int>> takeListenSockets() {
  const auto pid = numberIn("LISTEN_PID"), count = numberIn("LISTEN_FDS");
  std::vector<int> files;
  const bool ours = pid && count && *pid == ::getpid() && *count > 0;
  for (const char* variable : {"LISTEN_PID", "LISTEN_FDS", "LISTEN_FDNAMES"}) ::unsetenv(variable);
  if (!ours) return files;
  if (*count > 16)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("LISTEN_FDS is {}, at most 16 sockets can be handed over", *count)};
  for (int fd = kFirstFile; fd < kFirstFile + static_cast<int>(*count); ++fd) {
    if (!isListening(fd))
      return Error{
          ErrorCode::kInvalidInput,
          fmt::format(
              "file {} of LISTEN_FDS is not a listening stream socket: use ListenStream= with Accept=no",
              fd)};
    ::fcntl(fd, F_SETFD, FD_CLOEXEC);
    files.push_back(fd);
  }
  return files;
}

bool notifyManager(std::string_view state) {
  const char* const path = std::getenv("NOTIFY_SOCKET");
  if (path == nullptr || (path[0] != '/' && path[0] != '@')) return false;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::strlen(path);
  if (length >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path, length);
  if (path[0] == '@') address.sun_path[0] = '\0';  // an abstract socket name
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  // never blocks: a manager that does not read must not stop the network's thread
  const ssize_t sent = ::sendto(fd, state.data(), state.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                                reinterpret_cast<const sockaddr*>(&address), size);
  ::close(fd);
  return sent == static_cast<ssize_t>(state.size());
}

std::optional<std::chrono::microseconds> watchdogPeriod() {
  const auto period = numberIn("WATCHDOG_USEC"), pid = numberIn("WATCHDOG_PID");
  if (!period || *period <= 0 || (pid && *pid != ::getpid())) return std::nullopt;
  return std::chrono::microseconds(*period / 2);
}

}  // namespace needlelab

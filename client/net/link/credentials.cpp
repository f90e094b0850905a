#include "client/net/link/credentials.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <optional>
#include <utility>

#include "client/net/link/blocking_client.h"
#include "common/base/files/files.h"
#include "common/base/secret.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::string_view kHead = "needlelab-enrolment 1";
constexpr std::size_t kKeyBytes = 32;

/// Empty: not a key.
std::string keyOf(std::string_view hex) {
  std::string key;
  if (hex.size() != 2 * kKeyBytes) return key;
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    const int high = hexDigit(hex[i]), low = hexDigit(hex[i + 1]);
    if (high < 0 || low < 0) return {};
    key += static_cast<char>(high * 16 + low);
  }
  return key;
}

constexpr int kStopPoll_ms = 50;

/// Turns off the terminal's echo, and restores it at the end.
class SilentTerminal {
 public:
  SilentTerminal() : fd_(::open("/dev/tty", O_RDWR | O_CLOEXEC)) {
    if (fd_ < 0 || ::tcgetattr(fd_, &before_) != 0) return;
    termios silent = before_;
    silent.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    ready_ = ::tcsetattr(fd_, TCSAFLUSH, &silent) == 0;
  }
  ~SilentTerminal() {
    if (ready_) ::tcsetattr(fd_, TCSAFLUSH, &before_);
    if (fd_ >= 0) ::close(fd_);
  }
  SilentTerminal(const SilentTerminal&) = delete;
  SilentTerminal& operator=(const SilentTerminal&) = delete;
  [[nodiscard]] bool ready() const { return ready_; }

  void write(const std::string& text) const {
    // failing to show the prompt is not an error
    [[maybe_unused]] const auto written = ::write(fd_, text.data(), text.size());
  }
  /// Nothing: `stopped` returned true before the line was complete.
  [[nodiscard]] std::optional<std::string> readLine(std::size_t most_bytes,
                                                    const std::function<bool()>& stopped) const {
    std::string line;
    line.reserve(most_bytes + 1);  // growing would leave copies behind
    char c = 0;
    while (line.size() <= most_bytes) {
      pollfd ready{fd_, POLLIN, 0};
      while (stopped && ::poll(&ready, 1, kStopPoll_ms) <= 0)
        if (stopped()) return std::nullopt;
      const ssize_t count = ::read(fd_, &c, 1);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0 || c == '\n') break;
      line += c;
    }
    return line;
  }

 private:
  int fd_;
  termios before_{};
  bool ready_ = false;
};

}  // namespace

Result<std::string> readSecretLine(const std::filesystem::path& file) {
  // without ASSIGN_OR_RETURN, which would leave an unwiped copy
  auto text = readWholeFile(file, 64u << 10);
  if (!text.ok()) return text.error();
  const WipeAtEnd wiped(*text);
  warnWhenOthersMayRead(file);
  const std::string_view line = withoutMark(*text);
  return std::string(line.substr(0, line.find_first_of("\r\n")));
}

Result<std::string> passwordFromFile(const std::filesystem::path& file, const std::string& what) {
  ASSIGN_OR_RETURN(auto line, readSecretLine(file));
  if (line.empty())
    return Error{ErrorCode::kInvalidInput, file.string() + ": its first line, the " + what + ", is empty"};
  if (line.size() > kMostPasswordBytes)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}: its first line, the {}, has {} bytes, allowed are at most {}",
                             file.string(), what, line.size(), kMostPasswordBytes)};
  return line;
}

Result<std::string> readPassword(const std::filesystem::path& file, const std::string& prompt) {
  if (!file.empty()) return passwordFromFile(file);
  ASSIGN_OR_RETURN(auto password,
                   passwordFromTerminal(prompt, kMostPasswordBytes,
                                        "no terminal to ask for a password: use --password-file FILE"));
  if (password.empty() || password.size() > kMostPasswordBytes)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("the password has {} bytes, not 1 to {}", password.size(), kMostPasswordBytes)};
  return password;
}

Result<std::string> passwordFromTerminal(const std::string& prompt, std::size_t most_bytes,
                                         const std::string& no_terminal,
                                         const std::function<bool()>& stopped) {
  const SilentTerminal terminal;
  if (!terminal.ready()) return Error{ErrorCode::kInvalidInput, no_terminal};
  terminal.write(prompt);
  auto line = terminal.readLine(most_bytes, stopped);
  terminal.write("\n");
  if (!line) return Error{ErrorCode::kFailed, "stopped while waiting at the terminal"};
  return std::move(*line);
}

std::string bundleText(const Enrolment& enrolment) {
  return std::string(kHead) + "\nserver " + endpointsText(enrolment.servers) + "\nstation " +
         enrolment.station + "\nkey " + hexDigitsOf(enrolment.key) + "\n" + enrolment.ca_pem;
}

Result<Enrolment> parseBundle(std::string_view text, const std::string& source) {
  const auto bad = [&](const std::string& what) {
    return Error{ErrorCode::kInvalidInput,
                 source + ": " + what + "; it is made by needlelab-admin station enrol on the server"};
  };
  const auto line = [&text] {
    const auto end = text.find('\n');
    const std::string_view first = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    return first;
  };
  if (line() != kHead) return bad("line 1 is not '" + std::string(kHead) + "'");
  const auto value = [&](std::string_view name) -> std::string {
    const std::string_view found = line();
    if (!found.starts_with(name) || found.size() <= name.size() || found[name.size()] != ' ') return {};
    return std::string(found.substr(name.size() + 1));
  };
  Enrolment enrolment;
  auto servers = parseEndpoints(value("server"));
  if (!servers.ok()) return bad("line 2 is not 'server HOST:PORT'");
  enrolment.servers = *std::move(servers);
  enrolment.station = value("station");
  if (auto valid = checkName("station", enrolment.station); !valid.ok())
    return bad("line 3 is not 'station NAME'");
  enrolment.key = keyOf(value("key"));
  if (enrolment.key.empty()) return bad("line 4 is not 'key' and 64 hexadecimal digits");
  enrolment.ca_pem = text;
  if (!enrolment.ca_pem.starts_with("-----BEGIN CERTIFICATE-----"))
    return bad("line 5 does not begin a certificate");
  return enrolment;
}

EnrolmentFiles enrolmentFilesIn(const std::filesystem::path& folder) {
  return {folder / "server", folder / "ca.crt", folder / "station.key"};
}

std::filesystem::path defaultEnrolmentFolder() {
  if (::geteuid() == 0) return "/etc/needlelab";
  const char* const config = std::getenv("XDG_CONFIG_HOME");
  if (config != nullptr && config[0] == '/') return std::filesystem::path(config) / "needlelab";
  const char* const home = std::getenv("HOME");
  return std::filesystem::path(home != nullptr ? home : "/") / ".config" / "needlelab";
}

Status saveEnrolment(const Enrolment& enrolment, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Error{ErrorCode::kFailed, "cannot make " + folder.string() + ": " + error.message()};
  const EnrolmentFiles files = enrolmentFilesIn(folder);
  const std::string key = enrolment.station + ":" + hexDigitsOf(enrolment.key) + "\n";
  const std::string server = endpointsText(enrolment.servers) + "\n";
  RETURN_IF_ERROR(writeFileAtomically(files.key, viewOf(key), 0600));
  RETURN_IF_ERROR(writeFileAtomically(files.ca, viewOf(enrolment.ca_pem), 0644));
  return writeFileAtomically(files.server, viewOf(server), 0644);
}

Result<ProvenEnrolment> proveEnrolment(const Enrolment& enrolment, const std::filesystem::path& scratch) {
  const auto ca = scratch / fmt::format(".enrol-{}.crt", ::getpid());
  RETURN_IF_ERROR(writeFileAtomically(ca, viewOf(enrolment.ca_pem), 0600));
  ClientConfig config;
  config.setServers(enrolment.servers);
  config.ca_file = ca;
  config.program = programText("station");
  config.login = stationLogin(enrolment.station, enrolment.key);
  config.connect_timeout = kConnectOnceTimeout;
  auto client = BlockingClient::connect(config);
  ::unlink(ca.c_str());
  if (!client.ok()) return client.error();
  return ProvenEnrolment{client->welcome().name(), client->server()};
}

}  // namespace needlelab

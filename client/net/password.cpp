#include "client/net/password.h"

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <array>

#include "common/base/files.h"
#include "common/base/secret.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostBytes = 1024;

/// The terminal without echo, put back at the end.
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

  void say(const std::string& text) const {
    // a prompt that does not appear is no reason to fail
    [[maybe_unused]] const auto written = ::write(fd_, text.data(), text.size());
  }
  [[nodiscard]] std::string readLine() const {
    std::string line;
    char c = 0;
    while (line.size() <= kMostBytes && ::read(fd_, &c, 1) == 1 && c != '\n') line += c;
    return line;
  }

 private:
  int fd_;
  termios before_{};
  bool ready_ = false;
};

}  // namespace

Result<std::string> readPassword(const std::filesystem::path& file, const std::string& prompt) {
  std::string password;
  if (!file.empty()) {
    auto text = readWholeFile(file, 64u << 10);
    if (!text.ok()) return text.error();
    const WipeAtEnd wiped(*text);
    warnWhenOthersMayRead(file);
    password = text->substr(0, text->find_first_of("\r\n"));
  } else {
    const SilentTerminal terminal;
    if (!terminal.ready()) {
      return Error{ErrorCode::kInvalidInput, "no terminal to ask for a password: use --password-file FILE"};
    }
    terminal.say(prompt);
    password = terminal.readLine();
    terminal.say("\n");
  }
  if (password.empty() || password.size() > kMostBytes) {
    return Error{ErrorCode::kInvalidInput,
                 "the password" + (file.empty() ? std::string() : " in " + file.string()) + " has " +
                     std::to_string(password.size()) + " bytes, not 1 to " + std::to_string(kMostBytes)};
  }
  return password;
}

}  // namespace needlelab

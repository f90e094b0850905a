#include "client/admin/secrets.h"

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>

#include "common/base/files.h"
#include "common/base/secret.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxFileBytes = 4096;

/// The terminal with its echo off, as long as this lives.
class QuietTerminal {
 public:
  QuietTerminal() : fd_(::open("/dev/tty", O_RDWR | O_CLOEXEC)) {
    if (fd_ < 0 || ::tcgetattr(fd_, &before_) != 0) return;
    termios quiet = before_;
    quiet.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    ready_ = ::tcsetattr(fd_, TCSAFLUSH, &quiet) == 0;
  }
  ~QuietTerminal() {
    if (ready_) ::tcsetattr(fd_, TCSAFLUSH, &before_);
    if (fd_ >= 0) ::close(fd_);
  }
  QuietTerminal(const QuietTerminal&) = delete;
  QuietTerminal& operator=(const QuietTerminal&) = delete;
  [[nodiscard]] bool ready() const { return ready_; }

  void show(const std::string& text) const {
    if (::write(fd_, text.data(), text.size()) < 0) return;  // a prompt that is not seen harms nothing
  }
  [[nodiscard]] std::string readLine() const {
    std::string line;
    char c = 0;
    for (;;) {
      const ssize_t n = ::read(fd_, &c, 1);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0 || c == '\n' || line.size() > kMaxFileBytes) return line;
      line += c;
    }
  }

 private:
  int fd_;
  termios before_{};
  bool ready_ = false;
};

}  // namespace

Result<std::string> passwordFromFile(const std::filesystem::path& file) {
  auto text = readWholeFile(file, kMaxFileBytes);
  if (!text) return text.error();
  const WipeAtEnd wiped(*text);
  warnWhenOthersMayRead(file);
  std::string line = text->substr(0, text->find('\n'));
  if (!line.empty() && line.back() == '\r') line.pop_back();
  if (line.empty())
    return Error{ErrorCode::kInvalidInput, file.string() + ": its first line, the password, is empty"};
  return line;
}

Result<std::string> passwordFromTerminal(const std::string& prompt, const std::string& option) {
  const QuietTerminal terminal;
  if (!terminal.ready()) {
    return Error{ErrorCode::kInvalidInput,
                 prompt + ": there is no terminal to ask on; give " + option + " FILE"};
  }
  terminal.show(prompt + ": ");
  std::string password = terminal.readLine();
  terminal.show("\n");
  return password;
}

Result<std::string> newPasswordFromTerminal(const std::string& name, const std::string& option) {
  const auto first = passwordFromTerminal("new password of " + name, option);
  if (!first) return first;
  const auto second = passwordFromTerminal("the same again", option);
  if (!second) return second;
  if (*first != *second)
    return Error{ErrorCode::kInvalidInput, "the two passwords differ: nothing was changed"};
  return *first;
}

}  // namespace needlelab

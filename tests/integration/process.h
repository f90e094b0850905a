/// One of our programs as a child process: starts, kills and waits for it, and keeps its output.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/result.h"
#include "tests/support/patience.h"

namespace needlelab::test {

/// Its destructor kills and reaps the process.
class Process {
 public:
  /// Which of the test's open files the program inherits, beside its standard output and error.
  enum class Inherits : std::uint8_t { kNothing, kAll };
  /// `program` is a name in the build's bin folder or an absolute path; its standard output and error go to
  /// `log`.
  Process(const std::string& program, const std::vector<std::string>& arguments, std::filesystem::path log,
          Inherits inherits = Inherits::kNothing)
      : log_(std::move(log)) {
    const std::string path = program.starts_with('/') ? program : std::string(NEEDLELAB_BIN) + "/" + program;
    std::vector<char*> argv{const_cast<char*>(path.c_str())};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, 1, log_.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0600);
    posix_spawn_file_actions_adddup2(&files, 1, 2);
    // a socket that the test cuts later must not stay open in the program
    if (inherits == Inherits::kNothing) posix_spawn_file_actions_addclosefrom_np(&files, 3);
    const int error = ::posix_spawn(&pid_, path.c_str(), &files, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (error != 0) throw std::runtime_error("cannot start " + path);
  }
  ~Process() {
    signal(SIGKILL);
    (void)wait();
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) {
    if (!status_) ::kill(pid_, number);
  }
  /// Returns the exit code, −signal if it was killed, or empty if it still runs after `limit`.
  std::optional<int> wait(std::chrono::milliseconds limit = kPatience) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!status_) {
      int status = 0;
      if (::waitpid(pid_, &status, WNOHANG) == pid_) {
        status_ = WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status);
        break;
      }
      if (std::chrono::steady_clock::now() >= end) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return status_;
  }
  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Its output so far.
  [[nodiscard]] std::string said() const {
    std::ifstream file(log_);
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
  }

 private:
  std::filesystem::path log_;
  pid_t pid_ = -1;
  std::optional<int> status_;
};

/// The port that a server writes to this file once it listens. Errors: kFailed with the end of its output.
inline Result<std::uint16_t> portOf(Process& server, const std::filesystem::path& file) {
  std::string text;
  (void)eventually([&] {
    auto read = readWholeFile(file);
    if (read.ok()) text = *read;
    return !text.empty() || server.wait(std::chrono::milliseconds(0)).has_value();
  });
  if (!text.empty()) return static_cast<std::uint16_t>(std::stoi(text));
  const std::string said = server.said();
  return Error{ErrorCode::kFailed, "the server did not start: " +
                                       said.substr(said.size() - std::min<std::size_t>(said.size(), 2000))};
}

}  // namespace needlelab::test

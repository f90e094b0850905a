/// A test's own display (Xvfb) with mouse and keyboard (xdotool), for programs with windows.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

namespace needlelab::test {

/// Sets DISPLAY for this process and its children during its lifetime. One at a time.
class XDisplay {
 public:
  explicit XDisplay(int width_px = 1280, int height_px = 720) {
    const char* const before = std::getenv("DISPLAY");
    before_ = before == nullptr ? "" : before;
    int ends[2];
    if (::pipe(ends) != 0) return;
    const std::string out = std::to_string(ends[1]);
    const std::string screen = std::to_string(width_px) + "x" + std::to_string(height_px) + "x24";
    // The test chooses the number: servers that choose one themselves at the same time can choose the same,
    // and the second takes the first one's socket. It reports the number once it is up.
    const std::string own = ":" + std::to_string(100 + ::getpid() % 50'000);
    // -noreset: otherwise the server resets when its last client leaves, and drops clients that connect at
    // that moment. An xdotool that searches for a window that does not exist yet is such a last client.
    pid_ = start({"Xvfb", own, "-displayfd", out, "-screen", "0", screen, "-nolisten", "tcp", "-noreset"},
                 ends[1]);
    ::close(ends[1]);
    std::string number;
    char c = 0;
    while (::read(ends[0], &c, 1) == 1 && c != '\n') number += c;
    ::close(ends[0]);
    if (number.empty()) return;
    name_ = ":" + number;
    ::setenv("DISPLAY", name_.c_str(), 1);
  }
  ~XDisplay() {
    end();
    if (before_.empty())
      ::unsetenv("DISPLAY");
    else
      ::setenv("DISPLAY", before_.c_str(), 1);
  }
  XDisplay(const XDisplay&) = delete;
  XDisplay& operator=(const XDisplay&) = delete;

  /// False without Xvfb: skip the test with a message.
  [[nodiscard]] bool isThere() const { return !name_.empty(); }
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Simulates the loss of a display: its server ends at once.
  void end() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = -1;
    ::unlink(("/tmp/.X11-unix/X" + name_.substr(std::min<std::size_t>(1, name_.size()))).c_str());
  }

  /// Runs xdotool with these arguments, e.g. {"key", "Return"}; returns its exit code.
  int tool(std::vector<std::string> words) {
    words.insert(words.begin(), "xdotool");
    return run(words);
  }
  /// Presses and releases the key. A window of ours sees both, each in its own frame.
  void key(const std::string& name) { tool({"key", name}); }
  void keyDown(const std::string& name) { tool({"keydown", name}); }
  void keyUp(const std::string& name) { tool({"keyup", name}); }
  /// Sets the keyboard's layout: {"fr"}, {"us", "dvorak"}.
  bool layout(std::vector<std::string> words) {
    words.insert(words.begin(), "setxkbmap");
    return run(words) == 0;
  }
  void moveTo(int x_px, int y_px) { tool({"mousemove", std::to_string(x_px), std::to_string(y_px)}); }
  void moveBy(int dx_px, int dy_px) {
    tool({"mousemove_relative", "--", std::to_string(dx_px), std::to_string(dy_px)});
  }
  void buttonDown(int button) { tool({"mousedown", std::to_string(button)}); }
  void buttonUp(int button) { tool({"mouseup", std::to_string(button)}); }
  /// Notches of the wheel, all at once; positive away from the person.
  void wheel(int notches) {
    tool({"click", "--repeat", std::to_string(std::abs(notches)), "--delay", "1", notches > 0 ? "4" : "5"});
  }

 private:
  static int run(const std::vector<std::string>& words) {
    const pid_t pid = start(words, -1);
    int status = -1;
    if (pid <= 0 || ::waitpid(pid, &status, 0) != pid) return -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  // the descriptor `kept` stays open in the child
  static pid_t start(const std::vector<std::string>& words, int kept) {
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
    if (kept >= 0) posix_spawn_file_actions_adddup2(&files, kept, kept);
    pid_t pid = -1;
    const int error = ::posix_spawnp(&pid, argv[0], &files, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    return error == 0 ? pid : -1;
  }

  std::string before_, name_;
  pid_t pid_ = -1;
};

}  // namespace needlelab::test

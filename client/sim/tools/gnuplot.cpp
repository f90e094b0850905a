#include "client/sim/tools/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <system_error>

#include "common/base/files.h"

extern char** environ;  // POSIX: the environment that the child gets

namespace needlelab {
namespace {

std::string inGnuplotQuotes(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  return quoted + "'";
}

// the file's last lines, for an error message
std::string tailOf(const std::filesystem::path& path) {
  auto text = readWholeFile(path, 1u << 20);
  if (!text.ok()) return "no message";
  constexpr std::size_t kMost = 500;
  return text->size() > kMost ? text->substr(text->size() - kMost) : *text;
}

Status runGnuplot(const std::filesystem::path& script, const std::filesystem::path& messages) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                     0600);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  std::string program = "gnuplot", file = script.string();
  char* arguments[] = {program.data(), file.data(), nullptr};
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0)
    return Error{ErrorCode::kFailed, std::string("cannot start gnuplot: ") + std::strerror(error)};
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR)
      return Error{ErrorCode::kFailed, std::string("lost gnuplot: ") + std::strerror(errno)};
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return Error{ErrorCode::kFailed, "gnuplot failed: " + tailOf(messages)};
  return {};
}

}  // namespace

bool hasGnuplot() {
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "";
  while (!rest.empty()) {
    const std::size_t colon = rest.find(':');
    const auto candidate = std::filesystem::path(rest.substr(0, colon)) / "gnuplot";
    std::error_code unreadable;  // a folder of the PATH that we may not look into has no gnuplot for us
    if (::access(candidate.c_str(), X_OK) == 0 && std::filesystem::is_regular_file(candidate, unreadable))
      return true;
    rest.remove_prefix(colon == std::string_view::npos ? rest.size() : colon + 1);
  }
  return false;
}

Status plotPng(const std::string& script, const std::filesystem::path& png, int width, int height) {
  // everything beside the picture, under its name: nobody finds half of one
  const std::filesystem::path part = png.string() + ".part", text = png.string() + ".gp",
                              messages = png.string() + ".err";
  const std::string whole =
      "set terminal pngcairo size " + std::to_string(width) + "," + std::to_string(height) +
      " enhanced font 'DejaVu Sans,13' background '#ffffff'\nset encoding utf8\nset output " +
      inGnuplotQuotes(part.string()) + "\n" + script + "\nunset output\n";
  Status status = writeFileAtomically(text, viewOf(whole));
  if (status.ok()) status = runGnuplot(text, messages);
  std::error_code moved;
  if (status.ok()) {
    std::filesystem::rename(part, png, moved);
    if (moved) status = Error{ErrorCode::kFailed, png.string() + ": " + moved.message()};
  }
  std::error_code ignored;  // left-overs do no harm
  for (const auto& file : {part, text, messages}) std::filesystem::remove(file, ignored);
  return status;
}

}  // namespace needlelab

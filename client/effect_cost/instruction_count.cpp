#include "client/effect_cost/instruction_count.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <system_error>

#include "common/base/files/files.h"

extern char** environ;  // POSIX: the environment that the child gets

/// callgrind writes its counts at each call of this function; not inlined, because callgrind finds it by name
extern "C" [[gnu::noinline]] void needlelab_end_counted_part() {
  asm volatile("" ::: "memory");
}

namespace needlelab {
namespace {

namespace fs = std::filesystem;

// a temporary folder for callgrind's files; the destructor removes it
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "needlelab-count-XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// runs the command to its end; returns the exit status, or −1
int runQuietly(std::vector<std::string> command, const fs::path& messages) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, messages.c_str(), O_WRONLY | O_CREAT | O_TRUNC,
                                     0600);
  std::vector<char*> arguments;
  for (std::string& argument : command) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, arguments.front(), &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// the number after "totals:" in a file of callgrind
Result<std::uint64_t> totalIn(const fs::path& file) {
  auto text = readWholeFile(file, 64u << 20);
  if (!text.ok()) return text.error();
  for (const char* key : {"\ntotals: ", "\nsummary: "})
    if (const auto at = text->find(key); at != std::string::npos)
      return std::strtoull(text->c_str() + at + std::strlen(key), nullptr, 10);
  return Error{ErrorCode::kFailed, file.string() + " has no total"};
}

}  // namespace

bool hasValgrind() {
  const char* path = std::getenv("PATH");
  std::stringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (::access((fs::path(folder) / "valgrind").c_str(), X_OK) == 0) return true;
  return false;
}

void endCountedPart() {
  needlelab_end_counted_part();
}

std::string ownProgram() {
  std::error_code ignored;
  return fs::read_symlink("/proc/self/exe", ignored).string();
}

Result<std::vector<std::uint64_t>> countStepInstructions(const std::vector<std::string>& command,
                                                         std::size_t parts) {
  if (!hasValgrind()) return Error{ErrorCode::kUnavailable, "valgrind is not on the PATH (Debian: valgrind)"};
  const ScratchFolder scratch;
  if (scratch.path().empty())
    return Error{ErrorCode::kFailed,
                 std::string("cannot make a folder for callgrind: ") + std::strerror(errno)};
  const fs::path out = scratch.path() / "count", messages = scratch.path() / "messages";
  std::vector<std::string> whole = {"valgrind",
                                    "--tool=callgrind",
                                    "--collect-atstart=no",
                                    "--toggle-collect=needlelab::step(*",
                                    "--dump-before=needlelab_end_counted_part",
                                    "--callgrind-out-file=" + out.string()};
  whole.insert(whole.end(), command.begin(), command.end());
  if (const int status = runQuietly(whole, messages); status != 0) {
    const auto said = readWholeFile(messages, 1u << 20);
    const std::string text = said.ok() ? *said : "";
    return Error{ErrorCode::kFailed, "counting with valgrind failed (exit " + std::to_string(status) +
                                         "): " + text.substr(text.size() > 600 ? text.size() - 600 : 0)};
  }
  // count.1, count.2, … ; the last file has the counts after the last mark
  std::vector<std::uint64_t> counts;
  for (std::size_t part = 1; part <= parts; ++part) {
    const auto total = totalIn(out.string() + "." + std::to_string(part));
    if (!total.ok()) return total.error();
    counts.push_back(*total);
  }
  return counts;
}

}  // namespace needlelab

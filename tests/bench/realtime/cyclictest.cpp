#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "tests/bench/realtime/loop_slices.h"
#include "tests/support/temp_folder.h"

extern char** environ;

namespace needlelab::test {
namespace {

// the exit code; -1 when the program is not there
int runQuietly(const std::vector<std::string>& command) {
  std::vector<char*> arguments;
  for (const std::string& argument : command) arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t pid = 0;
  const int error = ::posix_spawnp(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return -1;
  int status = 0;
  ::waitpid(pid, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

}  // namespace

Result<Wakeups> runCyclictest(const SliceOptions& options) {
  const TempFolder folder;
  const auto file = folder.path() / "cyclictest.json";
  const long period_us = std::lround(1e6 / options.rate_hz);
  constexpr int kMostUs = 500'000;  // a stall beyond that counts as late anyway
  std::vector<std::string> command = {
      "cyclictest",
      "--quiet",
      "--mlockall",
      "--interval=" + std::to_string(period_us),
      "--loops=" + std::to_string(std::lround(options.slice_s * options.rate_hz)),
      "--histogram=" + std::to_string(kMostUs),
      "--json=" + file.string()};
  if (options.priority > 0) command.push_back("--priority=" + std::to_string(options.priority));
  if (const auto core = coreForLoop(options.cpu)) command.push_back("--affinity=" + std::to_string(*core));
  const int code = runQuietly(command);
  if (code == -1 || code == 127)
    return Error{ErrorCode::kUnavailable, "cyclictest is not there (package rt-tests)"};
  if (code != 0)
    return Error{ErrorCode::kUnavailable, "cyclictest ended with " + std::to_string(code) +
                                              "; it needs SCHED_FIFO: run as root, or ulimit -r 99"};
  auto text = readWholeFile(file);
  if (!text.ok()) return text.error();
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  if (json.is_discarded() || !json.contains("/thread/0/histogram"_json_pointer))
    return Error{ErrorCode::kUnavailable, "cyclictest's JSON has no histogram; its version is not 2.x?"};

  Wakeups wakeups;
  const auto& thread = json["thread"]["0"];
  wakeups.count = thread["cycles"].get<std::uint64_t>();
  std::uint64_t in_histogram = 0, periods = 0;
  for (const auto& [late_us, times] : thread["histogram"].items()) {
    const long us = std::stol(late_us);
    const auto n = times.get<std::uint64_t>();
    in_histogram += n;
    if (us >= period_us) wakeups.over_T += n;
    // it skips what a late wake-up missed
    periods += n * static_cast<std::uint64_t>(1 + us / period_us);
    for (std::uint64_t i = 0; i < n; ++i) wakeups.late.add(us * 1000 + 500);
  }
  const std::int64_t max_ns = thread["max"].get<std::int64_t>() * 1000;
  for (; in_histogram < wakeups.count; ++in_histogram) {
    ++wakeups.over_T;
    wakeups.late.add(max_ns);
    periods += static_cast<std::uint64_t>(1 + max_ns / 1000 / period_us);
  }
  wakeups.seconds = static_cast<double>(periods) / options.rate_hz;
  return wakeups;
}

}  // namespace needlelab::test

#include "server/live/process_facts.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace needlelab {
namespace {

std::string fileText(const char* path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// When this machine was started, seconds since 1970.
double bootTime() {
  std::istringstream stat(fileText("/proc/stat"));
  double seconds = 0;
  for (std::string line; std::getline(stat, line);)
    if (line.starts_with("btime ")) seconds = std::stod(line.substr(6));
  return seconds;
}

}  // namespace

ProcessFacts processFacts() {
  ProcessFacts facts;
  // the name stands in brackets and may hold anything: fields count from the last one (proc(5))
  const std::string stat = fileText("/proc/self/stat");
  const auto end = stat.rfind(')');
  if (end != std::string::npos) {
    const auto ticks_per_s = static_cast<double>(::sysconf(_SC_CLK_TCK));
    std::istringstream fields(stat.substr(end + 1));
    std::string field;
    for (int number = 3; fields >> field; ++number) {
      if (number == 14 || number == 15) facts.cpu_s += std::stod(field) / ticks_per_s;
      if (number == 20) facts.threads = std::stoull(field);
      if (number == 22) facts.started_unix_s = bootTime() + std::stod(field) / ticks_per_s;
      if (number == 24)
        facts.rss_bytes = std::stoull(field) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
    }
  }
  std::error_code error;
  for (auto at = std::filesystem::directory_iterator("/proc/self/fd", error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error))
    ++facts.open_files;
  // the one that reads the folder is among them
  if (facts.open_files > 0) --facts.open_files;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) facts.most_files = limit.rlim_cur;
  return facts;
}

}  // namespace needlelab

#include "tests/soak/process_sample.h"

#include <unistd.h>

#include <fstream>
#include <sstream>
#include <string>

#include "db/backup/database_files.h"

namespace needlelab::test {

std::optional<ProcessSample> sampleProcess(pid_t pid) {
  const std::filesystem::path proc = std::filesystem::path("/proc") / std::to_string(pid);
  ProcessSample sample;
  std::ifstream status(proc / "status");
  for (std::string line; std::getline(status, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key == "VmRSS:") words >> sample.rss_KiB;
    if (key == "RssAnon:") words >> sample.anon_KiB;
    if (key == "Threads:") words >> sample.threads;
  }
  // an ended process that is not yet reaped has no memory
  if (sample.rss_KiB == 0) return std::nullopt;

  // the name is in brackets and may contain anything: count fields from the last bracket
  std::ifstream stat_file(proc / "stat");
  std::string text((std::istreambuf_iterator<char>(stat_file)), {});
  const auto end = text.rfind(')');
  if (end == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(end + 1));
  std::string field;
  double ticks = 0;
  for (int number = 3; fields >> field; ++number)
    if (number == 14 || number == 15) ticks += std::stod(field);
  sample.cpu_s = ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));

  std::error_code error;
  for (auto at = std::filesystem::directory_iterator(proc / "fd", error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    std::error_code closed;
    const std::string target = std::filesystem::read_symlink(at->path(), closed).string();
    ++(target.find(kDatabaseFile) != std::string::npos ? sample.database_handles : sample.handles);
  }
  return sample;
}

std::uint64_t bytesBelow(const std::filesystem::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (auto at = std::filesystem::recursive_directory_iterator(folder, error);
       !error && at != std::filesystem::recursive_directory_iterator(); at.increment(error)) {
    std::error_code gone;
    if (!at->is_regular_file(gone)) continue;
    const auto size = at->file_size(gone);
    if (!gone) bytes += size;
  }
  return bytes;
}

}  // namespace needlelab::test

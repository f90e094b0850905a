/// The run's own needlelab-server, a child process with its own folder.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/integration/process.h"
#include "tests/operations/prometheus_text.h"
#include "tests/soak/process_sample.h"
#include "tests/support/patience.h"

namespace needlelab::test {

/// Name and key of a station; name and password of a person.
struct Enrolled {
  std::vector<std::pair<std::string, std::string>> stations;
  std::string user, password;
};

/// Creates the folder's database with the stations and one administrator. No server may be running on it.
/// Names are load-0001 …. `store`: as Store::Options::store_url; the folder remembers it. Errors: the
/// store's, which refuses the database of a lab whose keys are in another folder.
Result<Enrolled> enrol(const std::filesystem::path& data, std::size_t stations,
                       const std::string& store = {});

/// Thread: one at a time.
class OwnServer {
 public:
  /// `server`: the program. `folder` contains data/ and the server's log. `arguments`: additional ones.
  OwnServer(std::filesystem::path server, std::filesystem::path folder,
            std::vector<std::string> arguments = {});

  /// Starts it on a free port the first time, later on the same one. Errors: kFailed with the last lines of
  /// its log.
  Status start();
  /// kill -9.
  void kill();
  /// Sends SIGTERM; kFailed if the exit code is not 0.
  Status stop();
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] pid_t pid() const { return process_ ? process_->pid() : 0; }
  [[nodiscard]] bool running();
  [[nodiscard]] std::filesystem::path data() const { return folder_ / "data"; }
  [[nodiscard]] std::filesystem::path caFile() const { return data() / "tls" / "ca.crt"; }
  [[nodiscard]] std::filesystem::path log() const { return folder_ / "server.log"; }
  /// CPU time of the servers that were killed or stopped, up to the last sample of each; `sample` gives the
  /// running one's.
  [[nodiscard]] std::optional<ProcessSample> sample() const;
  /// Its metrics; empty if it does not answer within seconds.
  [[nodiscard]] Scrape scrape(std::chrono::milliseconds limit = kPatience) const;
  /// Live bytes of its heap, from its metrics; nothing if it does not answer at once.
  [[nodiscard]] std::optional<std::uint64_t> liveHeapBytes() const;
  [[nodiscard]] double earlierCpu_s() const { return earlier_cpu_s_; }

 private:
  Error failed(const std::string& what) const;
  std::filesystem::path server_, folder_;
  std::vector<std::string> arguments_;
  std::unique_ptr<Process> process_;
  std::uint16_t port_ = 0, metrics_port_ = 0;
  double earlier_cpu_s_ = 0;
};

/// Creates the data folder of a further server on the database of the server in `from`, which has run with
/// --together: runs `needlelab-admin server join` from `bin`. Errors: kFailed with its output.
Status joinServer(const std::filesystem::path& bin, const std::filesystem::path& from,
                  const std::filesystem::path& data, const std::string& name);

}  // namespace needlelab::test

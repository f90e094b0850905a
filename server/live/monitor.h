/// Prometheus metrics and a health check, and the port that serves them. deploy/OPERATIONS.md explains each
/// alarm.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/http_server.h"
#include "server/live/context.h"

namespace needlelab {

/// Facts of this process, from the kernel.
struct ProcessFacts {
  double cpu_s = 0;  ///< user and system
  double started_unix_s = 0;
  std::uint64_t rss_bytes = 0;
  std::uint64_t threads = 0;
  std::uint64_t open_files = 0, most_files = 0;
};

/// Reads /proc/self; a value that cannot be read stays 0. Thread: any.
ProcessFacts processFacts();

struct MonitorSettings {
  std::uint64_t min_free_bytes = 256u
                                 << 20;  ///< free on the database's disk: below it the server is not healthy
  std::chrono::seconds max_backup_age{0};           ///< 0: the age of the last backup is shown, not judged
  std::chrono::milliseconds write_patience{2'000};  ///< for the trial write of a health check
  std::chrono::milliseconds read_patience{2'000};   ///< for what is read from the disk
};

/// The values that a worker reads for the monitor; none of them is older than a second when it is shown,
/// unless the disk does not answer.
struct StoreFacts {
  std::uint64_t database_bytes = 0, wal_bytes = 0;
  std::uint64_t free_bytes = 0, disk_bytes = 0;
  std::uint64_t sessions_open = 0;
  std::uint64_t unsafe_chunks = 0;             ///< committed and in no verified backup
  std::optional<std::int64_t> backup_unix_ns;  ///< of the last verified backup
  std::int64_t certificate_end_unix_s = 0;     ///< 0: not known
  ProcessFacts process;
  std::string fault;     ///< why the database could not be read; empty: it could
  bool answered = true;  ///< false: the disk does not answer; the rest is from the last time that it did
};

/// Thread: one thread of `readers`; opens a reader's connection.
StoreFacts readStoreFacts(Store& store, const std::filesystem::path& certificate);

/// All metrics as Prometheus text. Thread: the network's.
std::string metricsText(const ServerContext& context, const StoreFacts& facts);

/// The health check's findings.
struct Health {
  bool writable = false;
  double last_commit_age_s = -1;      ///< below 0: there was none yet
  std::vector<std::string> problems;  ///< empty: healthy
};
/// One line of JSON, and 200 or 503. `now_unix_ns`: for ages.
HttpAnswer healthAnswer(const Health& health, const StoreFacts& facts, std::int64_t now_unix_ns);

/// Answers "/metrics" and "/healthz". Thread: the network's; the context must outlive it and all its answers.
class Monitor {
 public:
  Monitor(ServerContext& context, std::filesystem::path certificate, MonitorSettings settings);
  ~Monitor();
  Monitor(const Monitor&) = delete;
  Monitor& operator=(const Monitor&) = delete;

  Task<HttpAnswer> answer(std::string path);
  /// Waits for its worker. Before the store ends.
  void join();

 private:
  Task<StoreFacts> facts();
  Task<Health> health(const StoreFacts& facts);
  static Task<> tryWrite(Monitor& self);
  static Task<> read(Monitor& self);

  ServerContext& context_;
  const std::filesystem::path certificate_;
  const MonitorSettings settings_;
  asio::thread_pool worker_{1};  ///< a disk that hangs must not hang those who look after lessons
  std::optional<StoreFacts> facts_;
  std::int64_t facts_ns_ = 0;
  bool reading_ = false, writing_ = false;
  Signal read_, written_;  ///< something has ended: what was asked for, or somebody's patience
  std::uint64_t seen_commits_ = 0;
  std::int64_t last_commit_ns_ = 0;  ///< steady clock; 0: none seen yet
};

/// The port of `--metrics`: GET /metrics and GET /healthz, without TLS. One request a connection, answered
/// and closed; connections, bytes and time are bounded. The monitor must outlive it.
class MonitorPort : public HttpServer {
 public:
  MonitorPort(asio::io_context& io, Tcp::acceptor acceptor, Monitor& monitor);
  void stop() override;
  Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) override;
  std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) override;

 protected:
  bool admit(std::uint64_t id, const Tcp::endpoint& peer) override;

 private:
  Monitor& monitor_;
};

}  // namespace needlelab

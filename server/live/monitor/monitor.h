/// Prometheus metrics and a health check, and their port. deploy/OPERATIONS.md explains each alarm.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/base/http_server.h"
#include "server/live/context.h"
#include "server/live/work/offload.h"

namespace needlelab {

/// Resource usage of this process, from the kernel and the C library.
struct ProcessFacts {
  double cpu_s = 0;  ///< user and system
  double started_unix_s = 0;
  std::uint64_t rss_bytes = 0;
  std::uint64_t heap_live_bytes =
      0;  ///< allocated by the program and not freed: grows only through a leak or through work
  std::uint64_t threads = 0;
  std::uint64_t open_files = 0, max_files = 0;
};

/// Reads /proc/self; a value that cannot be read stays 0. Thread: any.
ProcessFacts processFacts();

struct MonitorSettings {
  std::uint64_t min_free_bytes =
      256u << 20;  ///< free on the data folder's disk: with less the server is not healthy
  std::chrono::seconds max_backup_age{0};             ///< 0: the last backup's age is shown but not checked
  std::chrono::milliseconds write_patience{2'000};    ///< time limit of a health check's test write
  std::chrono::milliseconds read_patience{2'000};     ///< time limit of reads from the disk
  std::chrono::milliseconds connection_time{10'000};  ///< then a connection ends, answered or not
};

/// Values that a worker reads for the monitor. At most a second old when shown, unless the disk does not
/// respond.
struct StoreFacts {
  std::uint64_t database_bytes = 0, wal_bytes = 0;
  std::uint64_t free_bytes = 0, disk_bytes = 0;
  std::uint64_t sessions_open = 0;
  std::uint64_t unsafe_chunks = 0;               ///< committed but not Safe
  std::optional<std::int64_t> backup_unix_ns;    ///< of the last verified backup
  Durability durability = Durability::kNothing;  ///< what an ack survives
  bool clock_ahead = false;                      ///< of the latest known time (db/sessions/seen_time.h)
  std::int64_t certificate_end_unix_s = 0;       ///< 0: unknown
  ProcessFacts process;
  std::string fault;     ///< why the database could not be read; empty if it could
  bool answered = true;  ///< false: the disk does not respond; the other values are old
};

/// Opens a reader's connection. `acks_are_safe`: as in the context. Thread: one thread of `readers`.
StoreFacts readStoreFacts(Store& store, const std::filesystem::path& certificate, bool acks_are_safe);

/// All metrics as Prometheus text. Thread: the network's.
std::string metricsText(const ServerContext& context, const StoreFacts& facts);

/// The result of the health check.
struct Health {
  bool writable = false;  ///< the database accepts writes; `problems` has whether recordings are stored
  double last_commit_age_s = -1;  ///< below 0: no commit yet
  /// With several servers on one database: time since it last knew the others' access changes; below 0:
  /// never.
  std::optional<double> access_heard_s{};
  std::vector<std::string> problems;  ///< empty: healthy
  /// The live connection to the lab's other servers, which stored data does not depend on; nothing: the lab
  /// has one server.
  struct Live {
    std::string trouble;               ///< empty: it is up
    std::vector<std::string> servers;  ///< the reachable ones
  };
  std::optional<Live> live{};
};
/// One line of JSON, with status 200 or 503. `now_unix_ns`: for ages.
HttpAnswer healthAnswer(const Health& health, const StoreFacts& facts, std::int64_t now_unix_ns);

/// Answers "/metrics" and "/healthz". Thread: the network's; the context must outlive it and all its answers.
class Monitor {
 public:
  Monitor(ServerContext& context, std::filesystem::path certificate, MonitorSettings settings);
  ~Monitor();
  Monitor(const Monitor&) = delete;
  Monitor& operator=(const Monitor&) = delete;

  Task<HttpAnswer> answer(std::string path);
  [[nodiscard]] const MonitorSettings& settings() const { return settings_; }
  /// Waits for its worker. Call before the store is destroyed.
  void join();

 private:
  Task<StoreFacts> facts();
  Task<Health> health(const StoreFacts& facts);
  [[nodiscard]] std::optional<Health::Live> live() const;
  static Task<> tryWrite(Monitor& self);
  static Task<> read(Monitor& self);

  ServerContext& context_;
  const std::filesystem::path certificate_;
  const MonitorSettings settings_;
  /// A separate pool, so that a hanging disk cannot block the pools that serve lessons.
  asio::thread_pool worker_{1};
  std::optional<StoreFacts> facts_;
  std::int64_t facts_ns_ = 0;
  bool reading_ = false, writing_ = false;
  Signal read_, written_;  ///< the read or write has ended, or a caller's time limit has passed
  std::uint64_t seen_commits_ = 0;
  std::int64_t last_commit_ns_ = 0;  ///< steady clock; 0: no commit seen yet
};

/// The port of `--metrics`: GET /metrics and GET /healthz, without TLS. One request per connection, then it
/// closes; connections, bytes and time are limited. The monitor must outlive it.
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

// --- the text for Prometheus: exposition format 0.0.4

/// Builds the text. Metric names and label names come from this program and must be legal
/// ([a-zA-Z_:][a-zA-Z0-9_:]*, asserted); label values may be any text and are escaped. Thread: one.
class PrometheusText {
 public:
  using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

  /// Begins a metric: "# HELP" and "# TYPE" (counter, gauge, histogram, summary). Its samples follow.
  void metric(std::string_view name, std::string_view type, std::string_view help);
  /// Adds a sample to the current metric; `suffix` is e.g. "_sum" or "_count".
  void sample(double value, Labels labels = {}, std::string_view suffix = {});

  /// Adds a metric with one sample.
  void counter(std::string_view name, double value, std::string_view help);
  void gauge(std::string_view name, double value, std::string_view help);

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
  std::string name_;
};

}  // namespace needlelab

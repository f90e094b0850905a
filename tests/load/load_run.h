/// A whole run: server, stations, viewers, faults, and the comparison at the end.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/load/load_options.h"
#include "tests/load/load_station.h"
#include "tests/load/load_viewer.h"
#include "tests/load/server/database_check.h"
#include "tests/load/server/process_use.h"
#include "tests/soak/process_sample.h"

namespace needlelab::test {

/// One sample of the run's own server.
struct ServerRow {
  double time_s = 0;  ///< since streaming began
  ProcessSample server;
  std::uint64_t starts = 0;  ///< starts of the server so far: memory and handles start over with each
  std::uint64_t data_bytes = 0;
  std::uint64_t live_KiB = 0;  ///< of its heap, only with faults: from the latest scrape of its metrics
};

struct LoadResult {
  LoadOptions options;
  std::string when, database_disk;  ///< the type of file system holding the own server's database
  double streamed_s = 0;            ///< from the first due sample to the last
  double connect_s = 0, drain_s = 0, check_s = 0;  ///< before, after, comparison
  std::uint64_t samples_made = 0;
  std::uint64_t stations_closed = 0;
  StationTotals stations;
  ViewerTotals viewers;
  DatabaseCheck stored;
  // during streaming; all servers together
  double server_cpu_s = 0, generator_cpu_s = 0;
  std::uint64_t server_rss_KiB = 0;  ///< maximum, of one server
  std::uint64_t server_handles = 0;  ///< maximum, of one server
  std::uint64_t database_bytes = 0;  ///< after the end
  /// During streaming: each of the run's own servers, PostgreSQL, its standby, NATS, the generator; as far as
  /// the run has them.
  std::vector<ProcessUse> processes;
  std::vector<std::size_t> stations_at;  ///< each server, at the end of streaming
  std::vector<ServerRow> rows;           ///< one per second, of the first server; empty with a foreign one
  std::uint64_t cuts = 0, kills = 0, pauses = 0;
  bool interrupted = false;           ///< ended early by a person
  std::vector<std::string> troubles;  ///< why stations did not get through, or the server ended

  [[nodiscard]] double stationSeconds() const { return static_cast<double>(samples_made) / 1000; }
  /// True if no sample is lost, duplicated, different or foreign, and all sessions are closed as complete.
  [[nodiscard]] bool good() const;
};

/// Another thread or a signal handler may set `interrupt`; the run then ends cleanly. Errors: kInvalidInput
/// (options), kFailed or kUnavailable if the run could not start.
Result<LoadResult> runLoad(const LoadOptions& options, const std::atomic<bool>& interrupt);

}  // namespace needlelab::test

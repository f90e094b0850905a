/// Runs a soak: server, station and viewer, sampled while they work; figures of each minute.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/soak/process_sample.h"

namespace needlelab::test {

enum SoakProcess : std::size_t { kServer, kStation, kViewer, kSoakProcesses };
inline constexpr std::array<const char*, kSoakProcesses> kSoakNames = {"server", "station", "viewer"};

/// The two forms of a soak. The short one judges losses, handles and threads; it says nothing of memory,
/// because in so little time a cache that fills looks like a leak. The nightly one judges memory as well.
enum class SoakForm : std::uint8_t { kShort, kNightly };
inline constexpr double kNightly_s = 600;  ///< the least length of the nightly form
const char* formText(SoakForm form);

struct SoakOptions {
  double seconds = 20;
  std::filesystem::path bin;  ///< where the programs are
  std::filesystem::path out;  ///< a new folder for everything
  double rate_hz = 1000;
  bool quiet = false;  ///< no progress on standard error

  [[nodiscard]] SoakForm form() const { return seconds < kNightly_s ? SoakForm::kShort : SoakForm::kNightly; }
  /// Between two samples.
  [[nodiscard]] double every_s() const;
  /// Warm-up, not judged: caches fill and pools reach their size.
  [[nodiscard]] double warmUp_s() const;
  /// Length of a "minute" of the report: shorter in a short run.
  [[nodiscard]] double minute_s() const;
};

/// One sample of all programs.
struct SoakRow {
  double time_s = 0;  ///< since the session began
  std::array<ProcessSample, kSoakProcesses> processes;
  std::uint64_t spool_bytes = 0, data_bytes = 0;  ///< the station's spool, the server's folder
  // the station's newest status line
  std::uint64_t samples = 0, missed_ticks = 0, spool_left = 0, wakeup_p99_us = 0;
  double request_ms = 0;  ///< the server's answer time to a request of this test
};

struct SoakData {
  std::vector<SoakRow> rows;          ///< while the station practised
  std::vector<std::string> troubles;  ///< trouble texts of the status lines, each once
  nlohmann::json summary;             ///< the station's
  int station_code = -1, viewer_code = -1, server_code = -1;
  std::uint64_t stored_samples = 0;  ///< in the database, by the server's word
  std::string stored_state;
  bool verified = false;  ///< chunks and hash, by the server's own check
};

/// Runs the soak; the programs' logs are in `out`. Errors: kFailed with the last log lines when a program did
/// not start or did not end.
Result<SoakData> runSoak(const SoakOptions& options);

// --- figures of each minute, from the recording and from the frames that the viewer saw

/// NaN where there are no data.
struct SoakMinute {
  double end_s = 0;
  std::uint64_t samples = 0;
  std::uint64_t missed_ticks = 0;  ///< gaps between the ticks of the recording
  double tick_p99_us = 0;          ///< device, engine and gate of a tick, from the recording
  double wakeup_p99_us = 0;        ///< of the haptic loop, since the session began
  double request_p99_ms = 0;       ///< the server's answers
  double live_p99_ms = 0;          ///< from capture to the viewer
};
using SoakMinutes = std::vector<SoakMinute>;

/// Reads the station's spool and the viewer's lines in `options.out`. Errors: kCorrupt, kNotFound.
Result<SoakMinutes> minutesOf(const SoakData& data, const SoakOptions& options);

/// The q-quantile: the least value that at least the share q of `values` does not exceed; NaN for no values.
double quantile(std::vector<double> values, double q);

}  // namespace needlelab::test

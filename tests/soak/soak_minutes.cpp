#include "tests/soak/soak_minutes.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "client/net/spool.h"
#include "common/gesture/chunk.h"

namespace needlelab::test {

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(values.size())));
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values.size()) - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

Result<SoakMinutes> minutesOf(const SoakData& data, const SoakOptions& options) {
  const double minute_s = options.minute_s();
  SoakMinutes minutes(static_cast<std::size_t>(std::ceil(options.seconds / minute_s)));
  const auto indexOf = [&](double time_s) {
    const auto index = static_cast<std::size_t>(std::max(0.0, time_s) / minute_s);
    return std::min(index, minutes.size() - 1);
  };
  std::vector<std::vector<double>> ticks(minutes.size()), requests(minutes.size()), live(minutes.size());

  // the recording
  auto file = SpoolFile::open(options.out / "spool" / data.summary.value("session_id", "none") / "chunks");
  if (!file.ok()) return file.error();
  std::uint64_t next_tick = 0;
  Status broken;
  const auto end = file->scan([&](const SpoolRecord& record) {
    const auto samples = decodeChunk(record.data);
    if (!samples.ok()) {
      broken = samples.error();
      return false;
    }
    for (const GestureSample& sample : *samples) {
      const std::size_t index = indexOf(static_cast<double>(sample.tick) / options.rate_hz);
      ++minutes[index].samples;
      minutes[index].missed_ticks += sample.tick - next_tick;
      next_tick = sample.tick + 1;
      ticks[index].push_back(1e-3 *
                             (static_cast<double>(sample.device_ns) + static_cast<double>(sample.engine_ns)));
    }
    return true;
  });
  if (!end.ok()) return end.error();
  if (!broken.ok()) return broken.error();

  // our own questions to the server
  for (const SoakRow& row : data.rows) {
    requests[indexOf(row.time_s)].push_back(row.request_ms);
    minutes[indexOf(row.time_s)].wakeup_p99_us = static_cast<double>(row.wakeup_p99_us);
  }

  // the viewer's lines
  std::ifstream lines(options.out / "viewer.jsonl");
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line, nullptr, false);
    if (!json.is_object() || !json.contains("latency_ms") || !json["latency_ms"].is_number()) continue;
    live[indexOf(json.value("time_s", 0.0))].push_back(json["latency_ms"].get<double>());
  }

  for (std::size_t i = 0; i < minutes.size(); ++i) {
    minutes[i].end_s = std::min(options.seconds, static_cast<double>(i + 1) * minute_s);
    minutes[i].tick_p99_us = quantile(std::move(ticks[i]), 0.99);
    minutes[i].request_p99_ms = quantile(std::move(requests[i]), 0.99);
    minutes[i].live_p99_ms = quantile(std::move(live[i]), 0.99);
  }
  return minutes;
}

}  // namespace needlelab::test

#include "tests/bench/realtime/figures.h"

#include <nlohmann/json.hpp>

namespace needlelab::test {
namespace {

double microseconds(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-3;
}

const char* besideText(Beside beside) {
  switch (beside) {
    case Beside::kRate:
      return "rate";
    case Beside::kMedian:
      return "wake-up p50";
    case Beside::kP99:
      return "wake-up p99";
    case Beside::kP999:
      return "wake-up p99.9";
    case Beside::kMax:
      return "wake-up max";
    case Beside::kOnTime:
      return "on time";
  }
  return "";
}

}  // namespace

void addWakeups(Figures& figures, const std::string& side, const Wakeups& wakeups) {
  const LatencyQuantiles q = wakeups.late.quantiles();
  const auto count = static_cast<double>(wakeups.count);
  figures.push_back({side + ": rate", "Hz", count / wakeups.seconds, Beside::kRate});
  figures.push_back({side + ": wake-up p50", "µs", microseconds(q.p50_ns), Beside::kMedian});
  figures.push_back({side + ": wake-up p99", "µs", microseconds(q.p99_ns), Beside::kP99});
  figures.push_back({side + ": wake-up p99.9", "µs", microseconds(q.p999_ns), Beside::kP999});
  figures.push_back({side + ": wake-up max", "µs", microseconds(q.max_ns), Beside::kMax});
  figures.push_back(
      {side + ": on time", "%", 100 * (1 - static_cast<double>(wakeups.over_T) / count), Beside::kOnTime});
}

void addQuantiles(Figures& figures, const std::string& name, const LatencyHistogram& durations) {
  const LatencyQuantiles q = durations.quantiles();
  figures.push_back({name + " p50", "µs", microseconds(q.p50_ns), Beside::kMedian});
  figures.push_back({name + " p99", "µs", microseconds(q.p99_ns), Beside::kP99});
}

void addLoop(Figures& figures, const SliceResult& slices) {
  addWakeups(figures, "haptic loop", slices.loop);
  addQuantiles(figures, "haptic loop: tick", slices.tick);
  figures.push_back({"haptic loop: process's wake-ups", "1/s",
                     static_cast<double>(slices.switches) / slices.loop.seconds, Beside::kRate});
}

std::string figuresJson(const Figures& figures, const std::string& more) {
  auto json = more.empty() ? nlohmann::ordered_json::object() : nlohmann::ordered_json::parse(more);
  json["figures"] = nlohmann::ordered_json::array();
  for (const Figure& figure : figures)
    json["figures"].push_back({{"name", figure.name},
                               {"unit", figure.unit},
                               {"value", figure.value},
                               {"beside", besideText(figure.beside)}});
  return json.dump(1);
}

}  // namespace needlelab::test

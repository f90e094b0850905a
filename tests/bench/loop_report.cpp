#include "tests/bench/loop_report.h"

#include <fmt/core.h>

#include <nlohmann/json.hpp>

#include "common/base/program.h"
#include "tests/bench/result_folder.h"

namespace needlelab::test {
namespace {

using Json = nlohmann::ordered_json;

double us(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-3;
}

Json wakeupsJson(const Wakeups& w) {
  const LatencyQuantiles q = w.late.quantiles();
  return {{"wakeups", w.count},
          {"p50_us", us(q.p50_ns)},
          {"p99_us", us(q.p99_ns)},
          {"p999_us", us(q.p999_ns)},
          {"max_us", us(q.max_ns)},
          {"late_by_T", w.over_T},
          {"share_late_by_T", w.shareOverT()}};
}

std::string row(const char* name, const Wakeups& w) {
  const LatencyQuantiles q = w.late.quantiles();
  return fmt::format("| {:<14} | {:8.1f} | {:8.1f} | {:8.1f} | {:8.1f} | {:9.4f} % | {:8} |\n", name,
                     us(q.p50_ns), us(q.p99_ns), us(q.p999_ns), us(q.max_ns), 100 * w.shareOverT(),
                     static_cast<unsigned long long>(w.count));
}

}  // namespace

std::vector<LoopVerdict> judge(const LoopBenchResult& result, const LoopGoals& goals) {
  const double loop = result.loop.shareOverT(), other = result.cyclictest.shareOverT();
  const double loop_us = us(result.loop.late.quantile_ns(0.99));
  const double other_us = us(result.cyclictest.late.quantile_ns(0.99));
  return {{loop <= other + goals.share_more,
           fmt::format("wake-ups late by more than a tick: {:.4f} %, at most {:.4f} % + {:.4g} %", 100 * loop,
                       100 * other, 100 * goals.share_more)},
          {loop_us <= goals.p99_ratio * other_us,
           fmt::format("wake-up p99: {:.1f} µs, at most {:.2g} × {:.1f} µs; ratio {:.2f}", loop_us,
                       goals.p99_ratio, other_us, other_us > 0 ? loop_us / other_us : 0)}};
}

std::string loopTable(const LoopBenchResult& result) {
  std::string text =
      "| wake-up        |   p50 µs |   p99 µs | p99.9 µs |   max µs | late by T   | wake-ups |\n"
      "|----------------|---------:|---------:|---------:|---------:|------------:|---------:|\n";
  text += row("haptic loop", result.loop) + row("cyclictest", result.cyclictest);
  const LatencyQuantiles tick = result.tick.quantiles();
  text += fmt::format(
      "\nThe loop's tick (device, gate, engine, record): p50 {:.1f} µs, p99 {:.1f} µs; {} ticks missed.\n",
      us(tick.p50_ns), us(tick.p99_ns), static_cast<unsigned long long>(result.missed_ticks));
  return text;
}

std::string loopJson(const LoopBenchResult& result, const LoopGoals& goals, const std::string& commit) {
  Json json = {{"version", NEEDLELAB_VERSION},
               {"machine", machineText()},
               {"when", nowText()},
               {"commit", commit},
               {"rate_hz", result.options.rate_hz},
               {"priority", result.options.priority},
               {"spin_us", us(result.options.spin_ns)},
               {"slice_s", result.options.slice_s},
               {"haptic_loop", wakeupsJson(result.loop)},
               {"cyclictest", wakeupsJson(result.cyclictest)},
               {"tick_p50_ns", result.tick.quantile_ns(0.5)},
               {"tick_p99_ns", result.tick.quantile_ns(0.99)},
               {"missed_ticks", result.missed_ticks}};
  for (const LoopVerdict& verdict : judge(result, goals))
    json["goals"].push_back({{"met", verdict.met}, {"text", verdict.text}});
  for (const SlicePair& slice : result.slices)
    json["slices"].push_back({{"first", slice.loop_first ? "haptic_loop" : "cyclictest"},
                              {"haptic_loop", wakeupsJson(slice.loop)},
                              {"cyclictest", wakeupsJson(slice.cyclictest)}});
  for (const RtStep& step : result.realtime)
    json["realtime"].push_back({{"name", step.name}, {"ok", step.ok}, {"message", step.message}});
  return json.dump(1) + "\n";
}

}  // namespace needlelab::test

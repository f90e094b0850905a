// Measures what needs this machine's own speed, and prints it as JSON; judges nothing.
// tests/bench/realtime/run starts it, adds the parts that are other programs, and compares with the baseline.
#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/base/program.h"
#include "tests/bench/realtime/figures.h"

namespace needlelab::test {
namespace {

int measure(const SliceOptions& options) {
  const auto progress = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  auto slices = runSlices(options, progress);
  if (!slices.ok()) {
    std::fprintf(stderr, "needlelab_realtime: %s\n", slices.error().message.c_str());
    return exitCodeOf(slices.error());
  }
  Figures figures;
  if (slices->cyclictest) addWakeups(figures, "cyclictest", *slices->cyclictest);
  addWakeups(figures, "plain loop", slices->plain);
  addLoop(figures, *slices);
  progress("the engine");
  addEngine(figures);
  progress("the store");
  if (const Status status = addRetention(figures, options.slice_s); !status.ok()) {
    std::fprintf(stderr, "needlelab_realtime: %s\n", status.error().message.c_str());
    return exitCodeOf(status.error());
  }
  progress("viewers that do not read");
  addViewers(figures, options.slice_s);
  nlohmann::ordered_json more = {{"version", programVersion()},
                                 {"machine", machineText()},
                                 {"seconds_each", options.seconds},
                                 {"slice_s", options.slice_s},
                                 {"rate_hz", options.rate_hz},
                                 {"missed_ticks", slices->missed_ticks},
                                 {"notes", nlohmann::ordered_json::array()}};
  for (const RtStep& step : slices->realtime)
    if (!step.ok) more["notes"].push_back(step.name + ": " + step.message);
  if (!slices->cyclictest_trouble.empty()) more["notes"].push_back(slices->cyclictest_trouble);
  std::printf("%s\n", figuresJson(figures, more.dump()).c_str());
  return kExitDone;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::SliceOptions options;
  double spin_us = 0;
  CLI::App app{"What needs this machine's own speed, as JSON", "needlelab_realtime"};
  app.add_option("--seconds", options.seconds, "of the haptic loop, of cyclictest, and of a plain loop")
      ->check(CLI::Range(0.1, 86'400.0))
      ->capture_default_str();
  app.add_option("--slice", options.slice_s, "seconds until the next one's turn")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  app.add_option("--rate", options.rate_hz)->check(CLI::Range(100.0, 10'000.0))->capture_default_str();
  app.add_option("--priority", options.priority, "0: without SCHED_FIFO")
      ->check(CLI::Range(0, 99))
      ->capture_default_str();
  app.add_option("--cpu", options.cpu, "core of all three")->check(CLI::Range(0, 1023));
  app.add_option("--spin-us", spin_us, "the haptic loop's")->check(CLI::Range(0.0, 200.0));
  CLI11_PARSE(app, argc, argv);
  options.spin_ns = static_cast<std::int64_t>(spin_us * 1000);
  return needlelab::test::measure(options);
}

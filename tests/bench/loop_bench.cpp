// Compares the haptic loop's wake-up with cyclictest's, in alternating slices, and judges it by the goals of
// README.md.
//
// cmake --build build/release --target record_loop_bench: two minutes, writes tests/bench/results/<machine>/
//
// build/release/bin/needlelab_loop_bench [--seconds 60]: only shows; exit code 1 when a goal is not met
#include <fmt/core.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "client/station/run/black_box.h"
#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/program.h"
#include "tests/bench/loop_report.h"
#include "tests/bench/result_folder.h"

namespace needlelab::test {
namespace {

// the cost of observing the loop
std::string watchingText() {
  auto histogram = std::make_unique<LatencyHistogram>();
  std::int64_t ns = 20'000;
  const Timing add = timeFor(0.1, [&] {
    histogram->add(ns);
    ns = 1 + ns * 5 % 60'013;
  });
  auto box = std::make_unique<BlackBox>(1000.0);
  BlackBoxTick tick;
  const Timing keeping = timeFor(0.1, [&] {
    ++tick.tick;
    box->next() = tick;
    box->commit();
  });
  return fmt::format(
      "A duration into a histogram that others may read: {:.1f} ns; a tick into the black box: {:.0f} ns "
      "(medians).\n",
      add.median_ns, keeping.median_ns);
}

Status record(const std::filesystem::path& results, const std::string& text, const std::string& json) {
  const auto folder = results / folderName(machineText());
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    return Error{ErrorCode::kInvalidInput, "cannot make " + folder.string() + ": " + error.message()};
  if (auto status = writeFileAtomically(folder / "loop.json", viewOf(json)); !status.ok()) return status;
  if (auto status = writeFileAtomically(folder / "loop.md", viewOf(text)); !status.ok()) return status;
  std::printf("written: %s\n", (folder / "loop.md").c_str());
  return {};
}

int bench(const LoopBenchOptions& options, const std::string& results, const std::string& commit) {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  auto result = runLoopBench(options, [&](const std::string& text) {
    std::fprintf(stderr, terminal ? "\r\x1b[K%s" : "%s\n", text.c_str());
  });
  if (terminal) std::fprintf(stderr, "\r\x1b[K");
  if (!result.ok()) {
    std::fprintf(stderr, "needlelab_loop_bench: %s\n", result.error().message.c_str());
    return exitCodeOf(result.error());
  }
  const LoopGoals goals;
  bool met = true;
  std::string text = loopTable(*result) + "\n";
  for (const LoopVerdict& verdict : judge(*result, goals)) {
    text += (verdict.met ? "- PASS " : "- FAIL ") + verdict.text + "\n";
    met = met && verdict.met;
  }
  text += "\n" + watchingText();
  std::printf("%s", text.c_str());
  if (!results.empty()) {
    const std::string head = fmt::format(
        "# The haptic loop's wake-up on this machine\n\n{}; {}; commit {}.\n\nWritten by `cmake --build "
        "build/release --target record_loop_bench`; slice by slice in loop.json. {:g} s of each at {:g} Hz "
        "and SCHED_FIFO {}, in slices of {:g} s in turn: the station's loop with the simulated device, black "
        "box and spool, and `cyclictest --mlockall` on its own. Goals: tests/bench/README.md.\n\n",
        machineText().c_str(), nowText().c_str(), commit.c_str(), options.seconds, options.rate_hz,
        options.priority, options.slice_s);
    if (auto status = record(results, head + text, loopJson(*result, goals, commit)); !status.ok()) {
      std::fprintf(stderr, "needlelab_loop_bench: %s\n", status.error().message.c_str());
      return exitCodeOf(status.error());
    }
  }
  return met ? kExitDone : kExitFailed;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  needlelab::test::LoopBenchOptions options;
  std::string results, commit;
  double spin_us = 0;
  CLI::App app{"The haptic loop's wake-up beside cyclictest's", "needlelab_loop_bench"};
  app.add_option("--seconds", options.seconds, "of each of the two")
      ->check(CLI::Range(1.0, 86'400.0))
      ->capture_default_str();
  app.add_option("--slice", options.slice_s, "seconds until the other's turn")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app.add_option("--rate", options.rate_hz)->check(CLI::Range(100.0, 10'000.0))->capture_default_str();
  app.add_option("--priority", options.priority)->check(CLI::Range(1, 99))->capture_default_str();
  app.add_option("--cpu", options.cpu,
                 "the core for both; default: the loop's as in a lesson, cyclictest's as the system chooses");
  app.add_option("--spin-us", spin_us, "the loop's last microseconds before each tick; cyclictest has none")
      ->check(CLI::Range(0.0, 200.0));
  app.add_option("--results", results, "folder to write <machine>/loop.md and loop.json to");
  app.add_option("--commit", commit, "what is measured, for the results");
  CLI11_PARSE(app, argc, argv);
  options.spin_ns = std::llround(spin_us * 1e3);
  return needlelab::test::bench(options, results, commit);
}

#include "tests/bench/step_record.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/bench/result_folder.h"

namespace needlelab::test {
namespace {

using Runs = std::vector<benchmark::BenchmarkReporter::Run>;

// shows as usual, and keeps the runs
class KeepingReporter : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const Runs& runs) override {
    kept.insert(kept.end(), runs.begin(), runs.end());
    ConsoleReporter::ReportRuns(runs);
  }
  Runs kept;
};

// the goals of README.md, in ns; the counter that each holds for
struct Goal {
  const char* counter;
  double most;
};
const std::map<std::string, Goal>& goals() {
  static const std::map<std::string, Goal> all = {
      {"hot/paper_four", {"p50_ns", 20}},
      {"hot/with_torque", {"p50_ns", 40}},
      {"hot/in_a_turn", {"p50_ns", 200}},
      {"hot/paper_four_beside_reference", {"ratio", 0.5}},
  };
  return all;
}

// "hot/paper_four/manual_time" → "hot/paper_four"
std::string plainName(const Runs::value_type& run) {
  return run.run_name.function_name;
}

std::string number(const Runs::value_type& run, const char* counter) {
  const auto found = run.counters.find(counter);
  if (found == run.counters.end()) return "";
  char text[40];
  std::snprintf(text, sizeof text, found->second.value < 1 ? "%.2f" : "%.1f", double{found->second.value});
  return text;
}

std::string verdict(const Runs::value_type& run) {
  const auto goal = goals().find(plainName(run));
  if (goal == goals().end()) return "|";
  const auto found = run.counters.find(goal->second.counter);
  if (found == run.counters.end()) return "|";
  const bool met = double{found->second.value} <= goal->second.most;
  char text[80];
  std::snprintf(text, sizeof text, "%s ≤ %g | %s", goal->second.counter, goal->second.most,
                met ? "met" : "**not met**");
  return text;
}

std::string readme(const Runs& runs, const RecordOptions& options, const std::string& when) {
  std::ostringstream text;
  text << "# The tick on this machine\n\n"
       << machineText() << "; " << when << (options.commit.empty() ? "" : "; commit " + options.commit)
       << ".\n\n"
       << "Written by `cmake --build build/release --target record_step_bench`; the whole of it is in "
          "step.json. "
          "`hot`: batches of 64 ticks, p50 and p99 over the batches' means. `cold`: one tick at a time, "
          "after a sleep of "
          "1 ms or with model, state and sample flushed from all caches; the empty call beside it is what "
          "any call costs there. What one reading of the clock costs is taken off everywhere.\n\n"
       << "| tick | p50 ns | p99 ns | literal reference p50 ns | ratio | goal | |\n"
       << "|---|---:|---:|---:|---:|---|---|\n";
  for (const auto& run : runs) {
    if (run.run_type != Runs::value_type::RT_Iteration) continue;
    text << "| " << plainName(run) << " | ";
    if (run.error_occurred)
      text << "not run: " << run.error_message << " | | | | | |\n";
    else
      text << number(run, "p50_ns") << " | " << number(run, "p99_ns") << " | "
           << number(run, "reference_p50_ns") << " | " << number(run, "ratio") << " | " << verdict(run)
           << " |\n";
  }
  return text.str();
}

}  // namespace

RecordOptions takeRecordOptions(int& argc, char** argv) {
  RecordOptions options;
  int kept = 1;
  for (int i = 1; i < argc; ++i) {
    if (i + 1 < argc && std::strcmp(argv[i], "--results") == 0)
      options.results = argv[++i];
    else if (i + 1 < argc && std::strcmp(argv[i], "--commit") == 0)
      options.commit = argv[++i];
    else
      argv[kept++] = argv[i];
  }
  argc = kept;
  return options;
}

int runAndRecord(const RecordOptions& options, int argc, char** argv) {
  std::vector<std::string> arguments(argv, argv + argc);
  const std::filesystem::path folder = options.results / folderName(machineText());
  if (!options.results.empty()) {
    std::error_code made;
    std::filesystem::create_directories(folder, made);
    if (made) {
      std::fprintf(stderr, "--results %s: cannot make the folder: %s\n", folder.c_str(),
                   made.message().c_str());
      return 2;
    }
    arguments.push_back("--benchmark_out=" + (folder / "step.json").string());
    arguments.push_back("--benchmark_out_format=json");
  }
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  int count = static_cast<int>(pointers.size());
  benchmark::Initialize(&count, pointers.data());
  if (benchmark::ReportUnrecognizedArguments(count, pointers.data())) return 2;
  benchmark::AddCustomContext("machine", machineText());
  if (!options.commit.empty()) benchmark::AddCustomContext("commit", options.commit);

  KeepingReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  bool failed = std::any_of(reporter.kept.begin(), reporter.kept.end(),
                            [](const Runs::value_type& run) { return run.error_occurred; });
  if (!options.results.empty()) {
    const std::string text = readme(reporter.kept, options, nowText());
    if (const Status status = writeFileAtomically(folder / "README.md", viewOf(text)); !status.ok()) {
      std::fprintf(stderr, "%s\n", status.error().message.c_str());
      failed = true;
    } else {
      std::printf("written: %s\n", (folder / "README.md").c_str());
    }
  }
  benchmark::Shutdown();
  return failed ? 1 : 0;
}

}  // namespace needlelab::test

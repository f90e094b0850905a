/// needlelab_load_growth: runs needlelab-load for each size, once with a profile, and writes the common
/// report.
#include <fmt/core.h>
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <iostream>

#include "common/base/files.h"
#include "common/base/program.h"
#include "tests/bench/result_folder.h"
#include "tests/integration/process.h"
#include "tests/load/load_report.h"
#include "tests/soak/process_sample.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

struct GrowthOptions {
  std::filesystem::path results;
  std::string commit = "unknown";
  std::vector<std::size_t> sizes = {1, 10, 50, 100, 200, 500, 1000};
  double seconds = 20;
  bool profile = true;
};

std::vector<std::string> loadArguments(std::size_t stations, double seconds,
                                       const std::filesystem::path& json) {
  return {"--stations", std::to_string(stations),     "--viewers", stations == 1 ? "1" : "10",
          "--seconds",  fmt::format("{:g}", seconds), "--json",    json};
}

Result<Json> runSize(std::size_t stations, double seconds, const TempFolder& folder) {
  const auto json = folder.path() / fmt::format("{}.json", stations);
  Process load("needlelab-load", loadArguments(stations, seconds, json), folder.path() / "load.log");
  static_cast<void>(load.wait(std::chrono::seconds(600)));
  auto text = readWholeFile(json);
  if (!text.ok()) return Error{ErrorCode::kFailed, "needlelab-load wrote no result: " + load.said()};
  return Json::parse(*text);
}

// the child of a process: its server
pid_t childOf(pid_t parent) {
  std::ifstream children(fmt::format("/proc/{}/task/{}/children", parent, parent));
  pid_t child = 0;
  children >> child;
  return child;
}

// profiles the server for some seconds in the middle of a run
Status profileServer(Growth& growth, std::size_t stations, const TempFolder& folder) {
  constexpr double kSpan_s = 8, kRun_s = 14;
  const auto data = folder.path() / "perf.data", text = folder.path() / "perf.txt";
  {
    Process perf("/usr/bin/env", {"perf", "--version"}, folder.path() / "perf.log");
    if (perf.wait(10s) != 0) return Error{ErrorCode::kNotFound, "there is no `perf` (Debian: linux-perf)"};
  }
  const auto log = folder.path() / "profiled.log";
  Process load("needlelab-load", loadArguments(stations, kRun_s, folder.path() / "profiled.json"), log);
  if (!eventually([&] { return load.said().find("connected in") != std::string::npos; }, 120s))
    return Error{ErrorCode::kFailed, "the run to be profiled did not begin: " + load.said()};
  std::this_thread::sleep_for(3s);
  growth.profiled_pid = childOf(load.pid());
  const auto before = sampleProcess(growth.profiled_pid);
  Process record("/usr/bin/env",
                 {"perf", "record", "-e", "cpu-clock", "-F", "499", "-g", "-o", data, "-p",
                  std::to_string(growth.profiled_pid), "--", "sleep", fmt::format("{:g}", kSpan_s)},
                 folder.path() / "perf.log");
  const auto begin = std::chrono::steady_clock::now();
  static_cast<void>(record.wait(60s));
  const auto after = sampleProcess(growth.profiled_pid);
  growth.profile_span_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  static_cast<void>(load.wait(300s));
  if (!before || !after) return Error{ErrorCode::kFailed, "the profiled server ended too early"};
  growth.profiled_s = after->cpu_s - before->cpu_s;
  Process script("/usr/bin/env", {"perf", "script", "-i", data, "-F", "tid,ip,sym,dso"}, text);
  if (script.wait(300s) != 0)
    return Error{ErrorCode::kFailed, "perf script failed: " + script.said().substr(0, 500)};
  ASSIGN_OR_RETURN(auto stacks, readWholeFile(text));
  growth.profile = profileOf(stacks);
  return {};
}

int run(const GrowthOptions& options) {
  const TempFolder folder;
  Growth growth;
  growth.commit = options.commit;
  for (const std::size_t stations : options.sizes) {
    std::fprintf(stderr, "%zu stations …\n", stations);
    auto result = runSize(stations, options.seconds, folder);
    if (!result.ok()) {
      std::fprintf(stderr, "needlelab_load_growth: %s\n", result.error().message.c_str());
      return kExitFailed;
    }
    growth.runs.push_back(std::move(*result));
  }
  growth.why_no_profile = "not asked for";
  if (options.profile) {
    std::fprintf(stderr, "profile at %zu stations …\n", options.sizes.back());
    if (const Status status = profileServer(growth, options.sizes.back(), folder); !status.ok())
      growth.why_no_profile = status.error().message;
  }

  std::cout << growthText(growth);
  const auto out = options.results / folderName(machineText());
  std::error_code error;
  std::filesystem::create_directories(out, error);
  for (const auto& [name, text] : {std::pair<const char*, std::string>{"load.md", growthText(growth)},
                                   {"load.json", growthJson(growth)}})
    if (const Status written = writeFileAtomically(out / name, viewOf(text)); !written.ok()) {
      std::fprintf(stderr, "needlelab_load_growth: %s\n", written.error().message.c_str());
      return kExitFailed;
    }
  if (const Status drawn = drawGrowth(growth, out / "load.png"); !drawn.ok())
    std::fprintf(stderr, "needlelab_load_growth: no picture: %s\n", drawn.error().message.c_str());
  std::cout << "written: " << out.string() << "/load.{md,json,png}\n";
  for (const GrowthVerdict& verdict : judgeGrowth(growth))
    if (!verdict.met) return kExitFailed;
  return kExitDone;
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) try {
  needlelab::test::GrowthOptions options;
  CLI::App app{"Runs needlelab-load for each number of stations and writes table, goals, profile and picture",
               "needlelab_load_growth"};
  app.add_option("--results", options.results, "folder of the results, e.g. tests/bench/results")->required();
  app.add_option("--commit", options.commit, "for the report");
  app.add_option("--sizes", options.sizes, "numbers of stations, smallest first")->delimiter(',');
  app.add_option("--seconds", options.seconds, "of streaming, each")->capture_default_str();
  app.add_flag("!--no-profile", options.profile, "leave the profile out");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? needlelab::kExitDone : needlelab::kExitInvalid;
  }
  return needlelab::test::run(options);
} catch (const std::exception& error) {
  std::fprintf(stderr, "needlelab_load_growth: %s\n", error.what());
  return needlelab::kExitFailed;
}

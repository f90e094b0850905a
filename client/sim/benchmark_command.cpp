/// `needlelab-sim benchmark`: compares models and laws with any folder of force curves, judged on held-out
/// data.
#include <fmt/core.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/sim/benchmark/benchmark.h"
#include "client/sim/command.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/curves/curve_set.h"

namespace needlelab {
namespace {

struct BenchmarkCommand {
  std::filesystem::path data, description, out;
  BenchmarkOptions options;
  double margin_percent = 10, calibration_mm = 5;
  bool no_times = false;
  std::vector<std::string> questions;  // empty = all
  std::vector<std::string> negate;     // "depth", "force"
  std::string encoding;
  CurveReading reading;
  JsonOption json;
};

// Before the work: the folder for pictures must exist and differ from the data's.
Status checkPaths(const BenchmarkCommand& command, const CurveSet& set) {
  if (!command.out.empty()) {
    std::error_code failed;
    std::filesystem::create_directories(command.out, failed);
    if (failed)
      return Error{ErrorCode::kInvalidInput,
                   "--out " + command.out.string() + ": cannot make the folder: " + failed.message()};
    if (std::filesystem::equivalent(command.out, command.data, failed))
      return Error{ErrorCode::kInvalidInput,
                   "--out " + command.out.string() + ": is the folder of the data; take another one"};
  }
  std::vector<NamedFile> inputs;
  for (const auto& file : set.files) inputs.push_back({"--data", file});
  return checkFolderOutputs(inputs, {"--out", command.out},
                            {"benchmark.csv", "benchmark.dat", "benchmark.png"}, command.json);
}

Status writeFiles(const BenchmarkReport& report, const std::filesystem::path& folder) {
  RETURN_IF_ERROR(writeFileAtomically(folder / "benchmark.csv", viewOf(benchmarkCsv(report))));
  const BenchmarkPicture picture = benchmarkPicture(report);
  const auto data = folder / "benchmark.dat";
  RETURN_IF_ERROR(writeFileAtomically(data, viewOf(picture.data)));
  if (!hasGnuplot()) {
    std::fprintf(stderr,
                 "needlelab-sim benchmark: gnuplot is not on the PATH: tables only (Debian: gnuplot-nox)\n");
    return {};
  }
  if (report.questions.empty()) return {};
  auto variables = picture.variables;
  variables.emplace_back("data", data.string());
  return drawPlot("benchmark", folder / "benchmark.png", variables);
}

int benchmark(const BenchmarkCommand& command) {
  CurveReading reading = command.reading;
  const auto negates = [&](const char* what) {
    return std::find(command.negate.begin(), command.negate.end(), what) != command.negate.end();
  };
  reading.negate_depth = negates("depth");
  reading.negate_force = negates("force");
  if (command.encoding == kEncodingNames[1]) reading.encoding = TextEncoding::kWindows1252;
  const auto set = readCurveSet(command.data, command.description, reading);
  if (!set.ok()) return failed("benchmark", set.error());
  if (const Status status = checkPaths(command, *set); !status.ok())
    return failed("benchmark", status.error());
  BenchmarkProgress progress;
  const bool shows = ::isatty(STDERR_FILENO) == 1;
  if (shows)
    progress = [](std::string_view doing, double share) {
      std::fprintf(stderr, "\r\033[K%3.0f %% %.*s", 100 * share, static_cast<int>(doing.size()),
                   doing.data());
    };
  BenchmarkOptions options = command.options;
  options.times = !command.no_times;
  options.margin = command.margin_percent / 100;
  options.calibration_m = command.calibration_mm / 1e3;
  for (const HoldOut what : kHoldOuts)
    if (std::find(command.questions.begin(), command.questions.end(), nameOf(what)) !=
        command.questions.end())
      options.questions.push_back(what);
  const auto report = runBenchmark(*set, options, progress);
  if (shows) std::fprintf(stderr, "\r\033[K");
  if (!report.ok()) return failed("benchmark", report.error());
  if (!command.json.wanted || !command.json.file.empty()) std::fputs(benchmarkText(*report).c_str(), stdout);
  if (command.json.wanted)
    if (const Status status = writeJson(command.json, benchmarkRows(*report), benchmarkRest(*report));
        !status.ok())
      return failed("benchmark", status.error());
  if (!command.out.empty())
    if (const Status status = writeFiles(*report, command.out); !status.ok())
      return failed("benchmark", status.error());
  return kExitDone;
}

}  // namespace

void addBenchmarkCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<BenchmarkCommand>();
  CLI::App* command = app.add_subcommand(
      "benchmark", "Models and laws against a folder of force curves, judged on what was held out");
  command
      ->add_option("--data", options->data,
                   "folder of CSV files of force over depth or time (client/sim/benchmark/README.md)")
      ->required();
  command->add_option("--describe", options->description,
                      "facts about the files, instead of the folder's data_set.json");
  command->add_option("--out", options->out,
                      "folder for benchmark.csv and benchmark.png (gnuplot); created if missing");
  command
      ->add_option("--numbers", options->options.max_numbers,
                   fmt::format("that a model may have at most, {} to {}", kMinNumbers, kMaxBenchmarkNumbers))
      ->check(CLI::NonNegativeNumber)  // -1 would be read as the largest number
      ->capture_default_str();
  command
      ->add_option("--margin", options->margin_percent,
                   "margin within which errors count as equal, in percent of the held-out rms force, 1 to 50")
      ->check(CLI::Range(100 * kMargin.min, 100 * kMargin.max))
      ->capture_default_str();
  command
      ->add_option("--calibrate", options->calibration_mm,
                   "depth to which specimen-start calibrates, in mm, 1 to 50")
      ->check(CLI::Range(1e3 * kCalibration_m.min, 1e3 * kCalibration_m.max))
      ->capture_default_str();
  std::vector<std::string> names;
  for (const HoldOut what : kHoldOuts) names.emplace_back(nameOf(what));
  command->add_option("--held-out", options->questions, "only this question; may be given several times")
      ->check(CLI::IsMember(names));
  command->add_flag("--no-times", options->no_times,
                    "times no tick: the same data then give the same output to the byte");
  command
      ->add_option("--negate", options->negate,
                   "the files count depth, or force, the other way; may be given twice")
      ->check(CLI::IsMember({"depth", "force"}));
  command
      ->add_option("--lines-above", options->reading.lines_above,
                   "lines above the header of each file, which an instrument writes, 0 to 1000")
      ->check(CLI::Range(0, 1000));
  command
      ->add_option("--encoding", options->encoding,
                   "what the files are written in, unless it is UTF-8 or UTF-16: windows-1252")
      ->check(CLI::IsMember(std::vector<std::string>(std::begin(kEncodingNames), std::end(kEncodingNames))));
  command
      ->add_option("--force-unit", options->reading.force_unit_N,
                   "what force_n is in: N (also above 20 N), mN, gf, kgf")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, double>{{"N", 1}, {"mN", 1e-3}, {"gf", 9.80665e-3}, {"kgf", 9.80665}}));
  command->add_flag("--tare", options->reading.tare,
                    "takes the force above the skin off: the sensor was not tared, or its zero drifts");
  command->add_flag("--digitised", options->reading.digitised,
                    "the rows are points of a figure, in any order of depth");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return benchmark(*options); }; });
}

}  // namespace needlelab

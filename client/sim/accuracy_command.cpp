/// `needlelab-sim accuracy`: the comparators and the cost of a tick, as table, JSON, CSV and picture.
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/effect_cost/tick_cost.h"
#include "client/sim/accuracy/report.h"
#include "client/sim/accuracy/study.h"
#include "client/sim/command.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

struct AccuracyCommand {
  JsonOption json;
  std::filesystem::path out;
  std::vector<std::string> studies = {"verification", "refinement"};
  bool long_form = false;
  bool no_instructions = false, count_only = false;
  double loop_s = 1.5;  // of each model, in each round
  std::string data;
};

// Returns the recordings' folder: from the option or the environment; empty without either.
Result<std::filesystem::path> dataFolder(const AccuracyCommand& command) {
  if (!command.data.empty()) {
    if (std::filesystem::is_directory(command.data)) return std::filesystem::path(command.data);
    return Error{ErrorCode::kInvalidInput, "--data " + command.data + ": is not a folder"};
  }
  const char* set = std::getenv("NEEDLELAB_DATA");
  const std::filesystem::path folder = set != nullptr ? set : "";
  std::error_code unreadable;  // treat as missing
  return std::filesystem::is_directory(folder, unreadable) ? folder : std::filesystem::path();
}

bool wanted(const AccuracyCommand& command, Comparator comparator) {
  return std::find(command.studies.begin(), command.studies.end(), textOf(comparator).name) !=
         command.studies.end();
}

// On a terminal, one line with the part, its share and the time since the start. Otherwise one line per part,
// so that a log shows the progress.
class ProgressLine {
 public:
  explicit ProgressLine(std::size_t parts) : parts_(parts) {}
  void begin(std::string_view part) {
    ++part_;
    share_ = 0;
    name_ = part;
    if (!terminal_)
      std::fprintf(stderr, "needlelab-sim accuracy: part %zu of %zu, %s (after %.0f s)\n", part_, parts_,
                   name_.c_str(), seconds());
  }
  AccuracyProgress callback() {
    if (!terminal_) return [](std::string_view, double) {};
    return [this](std::string_view doing, double share) {
      share_ = share;
      std::fprintf(stderr, "\r\033[K%zu/%zu %s: %3.0f %% %.*s (%.0f s)", part_, parts_, name_.c_str(),
                   100 * share_, static_cast<int>(doing.size()), doing.data(), seconds());
    };
  }
  void clear() const {
    if (terminal_) std::fprintf(stderr, "\r\033[K");
  }

 private:
  [[nodiscard]] double seconds() const { return static_cast<double>(steadyNowNs() - from_ns_) * 1e-9; }
  bool terminal_ = ::isatty(STDERR_FILENO) != 0;
  std::int64_t from_ns_ = steadyNowNs();
  std::size_t parts_, part_ = 0;
  double share_ = 0;
  std::string name_;
};

// Without valgrind the instruction column stays empty.
void addInstructions(const AccuracyCommand& command, std::vector<ModelCost>& costs,
                     std::vector<std::string>& notes) {
  if (command.no_instructions) return;
  if (!hasValgrind()) {
    notes.emplace_back("no instruction counts: valgrind is not on the PATH (Debian: valgrind)");
    return;
  }
  const Status counted = countInstructions({ownProgram(), "accuracy", "--count-only"}, costs);
  if (!counted.ok()) notes.push_back("no instruction counts: " + counted.error().message);
}

// Before the work, so that an unusable folder fails at once.
Status makeFolder(const std::filesystem::path& folder) {
  std::error_code made;
  std::filesystem::create_directories(folder, made);
  if (!made) return {};
  return Error{ErrorCode::kInvalidInput,
               "--out " + folder.string() + ": cannot make the folder: " + made.message()};
}

Status writeFiles(const std::filesystem::path& folder, const AccuracyRows& rows) {
  RETURN_IF_ERROR(writeFileAtomically(folder / "accuracy.csv", viewOf(accuracyCsv(rows))));
  if (!hasGnuplot()) {
    std::fprintf(stderr,
                 "needlelab-sim accuracy: gnuplot is not on the PATH: the table only, no picture (Debian: "
                 "gnuplot-nox)\n");
    return {};
  }
  auto variables = accuracyPicture(rows);
  variables.emplace_back("csv", (folder / "accuracy.csv").string());
  return drawPlot("accuracy", folder / "accuracy.png", variables);
}

void print(const AccuracyRows& rows) {
  std::printf("accuracy and its cost, on %s\n\n%s", machineText().c_str(), accuracyTable(rows).c_str());
}

int accuracy(const AccuracyCommand& command) {
  if (command.count_only) {
    const Status status = stepForCounting();
    return status.ok() ? kExitDone : failed("accuracy", status.error());
  }
  const auto data = dataFolder(command);
  if (!data.ok()) return failed("accuracy", data.error());
  if (!command.out.empty())
    if (const Status status = makeFolder(command.out); !status.ok())
      return failed("accuracy", status.error());
  if (const Status status =
          checkOutputs({}, {{"--out", command.out.empty() ? command.out : command.out / "accuracy.csv"},
                            {"--json", command.json.file}});
      !status.ok())
    return failed("accuracy", status.error());
  const auto parts =
      std::count_if(accuracyStudies().begin(), accuracyStudies().end(),
                    [&](const AccuracyStudy& study) { return wanted(command, study.comparator); });
  ProgressLine line(static_cast<std::size_t>(parts) + 1);
  AccuracyRows rows;
  std::vector<std::string> notes;
  const AccuracyOptions options{command.long_form, *data};
  for (const AccuracyStudy& study : accuracyStudies()) {
    if (!wanted(command, study.comparator)) continue;
    line.begin(textOf(study.comparator).name);
    auto more = study.run(options, line.callback(), notes);
    line.clear();
    if (!more.ok())
      return failed("accuracy", {more.error().code,
                                 std::string(textOf(study.comparator).name) + ": " + more.error().message});
    rows.insert(rows.end(), more->begin(), more->end());
  }
  line.begin("what a tick costs");
  auto costs = measureCosts(command.long_form ? 20 : command.loop_s, line.callback());
  if (!costs.ok()) return failed("accuracy", costs.error());
  addInstructions(command, *costs, notes);
  line.clear();
  addCosts(*costs, rows);
  for (const std::string& note : notes) std::fprintf(stderr, "needlelab-sim accuracy: %s\n", note.c_str());

  // report on standard output, unless the JSON goes there
  if (!command.json.wanted || !command.json.file.empty()) print(rows);
  if (command.json.wanted) {
    auto array = nlohmann::ordered_json::array();
    for (const AccuracyRow& row : rows) array.push_back(jsonOf(row));
    if (const Status status = writeJson(command.json, array); !status.ok())
      return failed("accuracy", status.error());
  }
  if (!command.out.empty())
    if (const Status status = writeFiles(command.out, rows); !status.ok())
      return failed("accuracy", status.error());
  return kExitDone;
}

}  // namespace

void addAccuracyCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<AccuracyCommand>();
  std::vector<std::string> names;
  for (const AccuracyStudy& study : accuracyStudies()) names.emplace_back(textOf(study.comparator).name);
  CLI::App* command =
      app.add_subcommand("accuracy", "What accuracy costs: the error of each model, and its price in time");
  addJsonOption(*command, options->json);
  command->add_option("--out", options->out, "folder for accuracy.csv and accuracy.png; created if missing");
  command->add_option("--study", options->studies, "this comparator; may be given several times")
      ->capture_default_str()
      ->check(CLI::IsMember(names));
  command->add_flag("--long", options->long_form, "more gestures, a finer mesh, longer loops: minutes");
  command->add_flag("--no-instructions", options->no_instructions,
                    "do not count instructions under valgrind");
  command->add_flag("--count-only", options->count_only)->group("");
  command->add_option("--loop-seconds", options->loop_s)->group("")->check(CLI::Range(0.05, 60.0));
  command->add_option("--data", options->data, "folder of the recordings; default: NEEDLELAB_DATA");
  command->callback([options, &chosen] { chosen = [options] { return accuracy(*options); }; });
}

}  // namespace needlelab

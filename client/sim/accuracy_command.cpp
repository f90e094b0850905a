/// `needlelab-sim accuracy`: the cost of accuracy in time, as tables, JSON, CSV and pictures.
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/effect_cost/instruction_count.h"
#include "client/sim/accuracy/recommendation.h"
#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/report.h"
#include "client/sim/accuracy/study.h"
#include "client/sim/accuracy/study_models.h"
#include "client/sim/command.h"
#include "client/sim/tools/gnuplot.h"
#include "client/sim/tools/json_output.h"
#include "common/base/clock.h"
#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct AccuracyCommand {
  JsonOption json;
  std::filesystem::path out;
  std::vector<std::string> studies;  // empty = all
  bool long_form = false, full = false;
  bool no_instructions = false, count_only = false;
  std::string data;
};

// the recordings' folder: from the option, the environment, or beside the project; empty when not found
Result<std::filesystem::path> dataFolder(const AccuracyCommand& command) {
  if (!command.data.empty()) {
    if (std::filesystem::is_directory(command.data)) return std::filesystem::path(command.data);
    return Error{ErrorCode::kInvalidInput, "--data " + command.data + ": is no folder"};
  }
  const char* set = std::getenv("NEEDLELAB_DATA");
  const std::filesystem::path folder = set != nullptr && *set != 0 ? set : "../shared/data";
  std::error_code unreadable;  // then it counts as missing
  return std::filesystem::is_directory(folder, unreadable) ? folder : std::filesystem::path();
}

bool wanted(const AccuracyCommand& command, AccuracyStudy study) {
  if (command.studies.empty()) return true;
  for (const std::string& name : command.studies)
    if (name == nameOf(study)) return true;
  return false;
}

// One line on a terminal: the part, its share, the time since the start. Elsewhere a line as each part
// begins, so that a log shows where it is.
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

// instructions break ties of time; without valgrind the ties stay
std::vector<CountedTick> countedTicks(const AccuracyCommand& command, std::vector<std::string>& notes) {
  if (command.no_instructions || !wanted(command, AccuracyStudy::kModel)) return {};
  if (!hasValgrind()) {
    notes.emplace_back("model: no instruction counts: valgrind is not on the PATH (Debian: valgrind)");
    return {};
  }
  auto counted = countStudyTicks({ownProgram(), "accuracy", "--count-only"});
  if (counted.ok()) return *std::move(counted);
  notes.push_back("model: no instruction counts: " + counted.error().message);
  return {};
}

// before the work, so that an unusable folder fails at once and not after minutes
Status makeFolder(const std::filesystem::path& folder) {
  std::error_code made;
  std::filesystem::create_directories(folder, made);
  if (!made) return {};
  return Error{ErrorCode::kInvalidInput,
               "--out " + folder.string() + ": cannot make the folder: " + made.message()};
}

Status writePictures(const AccuracyCommand& command, const AccuracyOptions& options, const AccuracyRows& rows,
                     ProgressLine& line) {
  RETURN_IF_ERROR(writeFileAtomically(command.out / "accuracy.csv", viewOf(accuracyCsv(rows))));
  if (!hasGnuplot()) {
    std::fprintf(stderr,
                 "needlelab-sim accuracy: gnuplot is not on the PATH: the table only, no pictures (Debian: "
                 "gnuplot-nox)\n");
    return {};
  }
  for (const AccuracyPicture& picture : accuracyPictures(rows)) {
    const auto data = command.out / (picture.name + ".dat");
    RETURN_IF_ERROR(writeFileAtomically(data, viewOf(picture.data)));
    auto variables = picture.variables;
    variables.emplace_back("data", data.string());
    RETURN_IF_ERROR(drawPlot("accuracy", command.out / (picture.name + ".png"), variables));
  }
  // the recorded curves with the models drawn into them
  if (!wanted(command, AccuracyStudy::kModel)) return {};
  line.begin("pictures");
  const auto recorded = recordedPictures(options, line.callback());
  line.clear();
  if (!recorded.ok()) return recorded.error();
  return drawRecordedPictures(*recorded, command.out);
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
  const auto parts = std::count_if(accuracyParts().begin(), accuracyParts().end(),
                                   [&](const AccuracyPart& part) { return wanted(command, part.study); });
  const bool counts = wanted(command, AccuracyStudy::kModel) && !command.no_instructions;
  const bool draws = wanted(command, AccuracyStudy::kModel) && !command.out.empty() && hasGnuplot();
  ProgressLine line(static_cast<std::size_t>(parts) + (counts ? 1u : 0u) + (draws ? 1u : 0u));
  AccuracyRows rows;
  std::vector<std::string> notes;
  AccuracyOptions options{command.long_form || command.full, *data, command.full, {}, {}};
  if (counts) {
    line.begin("instructions of a tick");
    options.counted = countedTicks(command, notes);
  }
  for (const AccuracyPart& part : accuracyParts()) {
    if (!wanted(command, part.study)) continue;
    line.begin(part.name);
    auto more = part.run(options, line.callback(), notes);
    line.clear();
    if (!more.ok())
      return failed("accuracy",
                    {more.error().code, "study " + std::string(nameOf(part.study)) + ", " +
                                            std::string(part.name) + ": " + more.error().message});
    rows.insert(rows.end(), more->begin(), more->end());
  }
  for (const std::string& note : notes) std::fprintf(stderr, "needlelab-sim accuracy: %s\n", note.c_str());

  // the report on standard output, unless the JSON goes there
  if (!command.json.wanted || !command.json.file.empty()) {
    std::printf("what accuracy costs in time, on %s\n\n%s", machineText().c_str(),
                accuracyTables(rows).c_str());
    std::printf("recommendation, computed from these rows\n");
    for (const std::string& paragraph : recommendation(rows))
      std::fputs(wrapped(paragraph, 118, "  ").c_str(), stdout);
  }
  if (command.json.wanted) {
    auto array = nlohmann::ordered_json::array();
    for (const AccuracyRow& row : rows) array.push_back(jsonOf(row));
    if (const Status status = writeJson(command.json, array); !status.ok())
      return failed("accuracy", status.error());
  }
  if (!command.out.empty())
    if (const Status status = writePictures(command, options, rows, line); !status.ok())
      return failed("accuracy", status.error());
  return kExitDone;
}

}  // namespace

void addAccuracyCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<AccuracyCommand>();
  CLI::App* command = app.add_subcommand(
      "accuracy",
      "Says what accuracy costs in time: models, FEM meshes, rates, stored resolution, live frames");
  addJsonOption(*command, options->json);
  command->add_option("--out", options->out,
                      "folder for accuracy.csv and the pictures; made when it is not there");
  command->add_option("--study", options->studies, "only this study; may be given several times")
      ->check(
          CLI::IsMember(std::vector<std::string>(kAccuracyStudyNames.begin(), kAccuracyStudyNames.end())));
  command->add_flag("--long", options->long_form, "more gestures, more repeats, larger meshes: minutes");
  command->add_flag(
      "--full", options->full,
      "--long with the loop of milliseconds and the finest meshes, without a limit of time: hours");
  command->add_flag("--no-instructions", options->no_instructions,
                    "do not count instructions under valgrind, which break ties of time");
  command->add_flag("--count-only", options->count_only)->group("");
  command->add_option("--data", options->data,
                      "folder of the recordings; default: NEEDLELAB_DATA, else ../shared/data");
  command->callback([options, &chosen] { chosen = [options] { return accuracy(*options); }; });
}

}  // namespace needlelab

/// `needlelab-sim accuracy`: the cost of accuracy in time, as tables, JSON, CSV and pictures.
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "client/sim/accuracy/recommendation.h"
#include "client/sim/accuracy/recorded.h"
#include "client/sim/accuracy/report.h"
#include "client/sim/accuracy/study.h"
#include "client/sim/command.h"
#include "client/sim/tools/gnuplot.h"
#include "client/sim/tools/json_output.h"
#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct AccuracyCommand {
  JsonOption json;
  std::filesystem::path out;
  std::vector<std::string> studies;  // empty = all
  bool long_form = false;
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

AccuracyProgress progressOnTerminal() {
  if (::isatty(STDERR_FILENO) == 0) return [](std::string_view, double) {};
  return [](std::string_view doing, double share) {
    std::fprintf(stderr, "\r\033[K%3.0f %% %.*s", 100 * share, static_cast<int>(doing.size()), doing.data());
  };
}

// before the work, so that an unusable folder fails at once and not after minutes
Status makeFolder(const std::filesystem::path& folder) {
  std::error_code made;
  std::filesystem::create_directories(folder, made);
  if (!made) return {};
  return Error{ErrorCode::kInvalidInput,
               "--out " + folder.string() + ": cannot make the folder: " + made.message()};
}

Status writePictures(const AccuracyCommand& command, const AccuracyOptions& options,
                     const AccuracyRows& rows) {
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
  const auto recorded = recordedPictures(options, progressOnTerminal());
  if (::isatty(STDERR_FILENO) != 0) std::fprintf(stderr, "\r\033[K");
  if (!recorded.ok()) return recorded.error();
  return drawRecordedPictures(*recorded, command.out);
}

int accuracy(const AccuracyCommand& command) {
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
  const AccuracyOptions options{command.long_form, *data};
  const AccuracyProgress progress = progressOnTerminal();
  AccuracyRows rows;
  std::vector<std::string> notes;
  for (const AccuracyPart& part : accuracyParts()) {
    if (!wanted(command, part.study)) continue;
    auto more = part.run(options, progress, notes);
    if (::isatty(STDERR_FILENO) != 0) std::fprintf(stderr, "\r\033[K");
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
    if (const Status status = writePictures(command, options, rows); !status.ok())
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
  command->add_option("--data", options->data,
                      "folder of the recordings; default: NEEDLELAB_DATA, else ../shared/data");
  command->callback([options, &chosen] { chosen = [options] { return accuracy(*options); }; });
}

}  // namespace needlelab

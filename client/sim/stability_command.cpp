/// `needlelab-sim stability`: the hard cases of DESIGN §10 over all axial models.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <vector>

#include "client/sim/command.h"
#include "client/sim/stability/case_output.h"
#include "client/sim/stability/scan_limits.h"
#include "client/sim/stability_pictures.h"
#include "client/sim/tools/gnuplot.h"
#include "client/sim/tools/json_output.h"
#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct StabilityOptions {
  JsonOption json;
  std::filesystem::path out, cases;  // empty = none, compiled in
  std::vector<std::string> only_cases, only_models;
  bool long_form = false;
};

// the asked-for of all there is, in their order; all when nothing was asked for
template <typename T, typename NameOf>
Result<std::vector<T>> chosenOf(const std::vector<T>& all, const std::vector<std::string>& wanted,
                                const char* option, NameOf&& name_of) {
  if (wanted.empty()) return all;
  std::string known;
  for (const T& one : all) known += (known.empty() ? "" : ", ") + std::string(name_of(one));
  for (const std::string& name : wanted)
    if (std::none_of(all.begin(), all.end(), [&](const T& one) { return name_of(one) == name; }))
      return Error{ErrorCode::kInvalidInput,
                   std::string(option) + ": there is no '" + name + "'; there are " + known};
  std::vector<T> chosen;
  for (const T& one : all)
    if (std::find(wanted.begin(), wanted.end(), name_of(one)) != wanted.end()) chosen.push_back(one);
  return chosen;
}

// the line on a terminal's stderr that says how far it is
class Progress {
 public:
  explicit Progress(std::size_t all) : all_(all), shown_(::isatty(STDERR_FILENO) != 0) {}
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void next(const std::string& name, AxialModel model) {
    ++done_;
    say(std::to_string(done_) + "/" + std::to_string(all_) + " " + name + ", " +
        std::string(shortName(model)));
  }
  void say(const std::string& words) {
    if (!shown_) return;
    std::fprintf(stderr, "\r\033[K%s", words.c_str());
    std::fflush(stderr);
  }
  void clear() { say(""); }

 private:
  std::size_t all_, done_ = 0;
  bool shown_;
};

// the rows' pictures, and with all cases the study of stiffness, which has its own runs
Status draw(const std::vector<CaseOutcome>& outcomes, const CaseSettings& settings,
            const StabilityOptions& options, Progress& progress) {
  if (const Status status = drawStability(outcomes, options.out); !status.ok()) return status;
  if (!options.only_cases.empty()) return {};
  const auto limits = drawStiffnessLimits(options.out, settings, [&](std::string_view doing, double share) {
    char percent[16];
    std::snprintf(percent, sizeof percent, "%3.0f %% ", 100 * share);
    progress.say(percent + std::string(doing));
  });
  progress.clear();
  if (!limits.ok()) return limits.error();
  for (const std::string& note : limits->notes)
    std::fprintf(stderr, "needlelab-sim stability: %s\n", note.c_str());
  return {};
}

// what failed, small enough to be read and kept
Status writeAttachments(const std::vector<CaseOutcome>& outcomes, const std::filesystem::path& folder) {
  for (const CaseOutcome& outcome : outcomes)
    for (const CaseAttachment& one : outcome.files)
      if (Status status = writeFileAtomically(folder / one.name, viewOf(one.text)); !status.ok())
        return status;
  return {};
}

int stability(const StabilityOptions& options) {
  const auto file = options.cases.empty() ? CaseFile::embedded() : CaseFile::load(options.cases);
  if (!file.ok()) return failed("stability", file.error());
  const auto cases = chosenOf(allCases(), options.only_cases, "--case",
                              [](const StabilityCase& one) { return std::string_view(one.name); });
  if (!cases.ok()) return failed("stability", cases.error());
  std::vector<AxialModel> all_models;
  for (std::size_t i = 0; i < kAxialModelCount; ++i) all_models.push_back(static_cast<AxialModel>(i));
  const auto models = chosenOf(all_models, options.only_models, "--model", axialModelName);
  if (!models.ok()) return failed("stability", models.error());
  std::error_code made;
  if (!options.out.empty()) std::filesystem::create_directories(options.out, made);
  if (made)
    return failed("stability", {ErrorCode::kInvalidInput, "--out " + options.out.string() +
                                                              ": cannot make the folder: " + made.message()});
  if (const Status status = checkOutputs({{"--cases", options.cases}}, {{"--json", options.json.file}});
      !status.ok())
    return failed("stability", status.error());

  const ForceSourceFactory engine = engineSource();
  const CaseSettings settings{*file, options.long_form};
  std::vector<CaseOutcome> outcomes;
  std::vector<CaseRow> rows;
  Progress progress(cases->size() * models->size());
  for (const StabilityCase& one : *cases)
    for (const AxialModel model : *models) {
      progress.next(one.name, model);
      auto outcome = runCase(one, settings, model, engine);
      if (!outcome.ok()) {
        progress.clear();
        return failed("stability", outcome.error());
      }
      rows.push_back(outcome->row);
      outcomes.push_back(*std::move(outcome));
    }
  progress.clear();

  if (!options.json.wanted || !options.json.file.empty()) std::fputs(rowsText(rows).c_str(), stdout);
  if (options.json.wanted)
    if (const Status status = writeJson(options.json, rowsJson(rows)); !status.ok())
      return failed("stability", status.error());
  if (!options.out.empty())
    if (const Status status = draw(outcomes, settings, options, progress); !status.ok()) {
      progress.clear();
      return failed("stability", status.error());
    }

  if (!options.out.empty())
    if (const Status status = writeAttachments(outcomes, options.out); !status.ok())
      return failed("stability", status.error());

  // what ships must be stable; the others may be what they are
  const auto unstable = std::find_if(rows.begin(), rows.end(), [](const CaseRow& row) {
    return row.model == AxialModel::kEnhancedTrackingWall && row.applicable &&
           row.verdict != Verdict::kStable;
  });
  if (unstable == rows.end()) return kExitDone;
  return failed("stability",
                {ErrorCode::kFailed, "the enhanced tracking wall is not stable in " + unstable->case_name});
}

}  // namespace

void addStabilityCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<StabilityOptions>();
  CLI::App* command =
      app.add_subcommand("stability",
                         "Runs the hard cases in closed loop over all axial models: chatter, force steps, "
                         "energy. Exit code 1 when the enhanced tracking wall is not stable");
  addJsonOption(*command, options->json);
  command->add_option(
      "--out", options->out,
      "folder for pictures, and for the largest stable stiffness per model; made when it is not there");
  command->add_option("--case", options->only_cases, "only this case; may be given several times")
      ->take_all();
  command->add_option("--model", options->only_models, "only this axial model; may be given several times")
      ->take_all();
  command->add_option("--cases", options->cases, "a cases.json in place of the compiled-in one");
  command->add_flag("--long", options->long_form, "the long form: more hands, more gestures");
  command->callback([options, &chosen] { chosen = [options] { return stability(*options); }; });
}

}  // namespace needlelab

/// `needlelab-sim stability`: the hard cases (tests/stability/README.md) for all axial models.
#include <fmt/core.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "client/sim/command.h"
#include "client/sim/device_study.h"
#include "client/sim/stability/case.h"
#include "client/sim/stability/scan_limits.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct StabilityOptions {
  JsonOption json;
  std::filesystem::path out, cases, device;  // empty: none; the compiled-in ones; the cases
  std::vector<std::string> only_cases, only_models;
  bool long_form = false;
};

// The members of `all` named in `wanted`, in their order; all if `wanted` is empty.
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

// Progress line on a terminal's stderr.
class Progress {
 public:
  explicit Progress(std::size_t all) : all_(all), shown_(::isatty(STDERR_FILENO) != 0) {}
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void next(const std::string& name, AxialModel model) {
    ++done_;
    show(fmt::format("{}/{} {}, {}", done_, all_, name, shortName(model)));
  }
  void show(const std::string& text) {
    if (!shown_) return;
    std::fprintf(stderr, "\r\033[K%s", text.c_str());
    std::fflush(stderr);
  }
  void clear() { show(""); }

 private:
  std::size_t all_, done_ = 0;
  bool shown_;
};

// ---- pictures

// A cell's text: its number; * where a second condition, given in the row's note, fails.
std::string cellText(const CaseRow& row) {
  if (row.neighbours) return neighboursText(*row.neighbours);
  const bool other = !row.passed && row.measured && row.limit && *row.measured <= *row.limit;
  return shortNumber(row.measured) + (other ? " *" : "");
}

// A case's line of the picture.
struct CaseLine {
  std::string title, limit;
  std::vector<const CaseRow*> cells;  // by model; null where it does not apply
  int trouble = 0;                    // models that chatter, and twice those that diverge
  bool all_equal = true;              // every cell says the same
};

// The most troubled case first.
std::vector<CaseLine> linesOf(const std::vector<CaseRow>& rows) {
  std::vector<CaseLine> lines;
  for (const std::string& name : caseNames(rows)) {
    CaseLine& line = lines.emplace_back();
    const CaseRow* first = nullptr;
    for (const AxialModel model : modelsOf(rows)) {
      const CaseRow* row = rowOf(rows, name, model);
      if (row != nullptr) line.title = row->title;
      if (row == nullptr || !row->applicable) row = nullptr;
      line.cells.push_back(row);
      if (row == nullptr) continue;
      if (first == nullptr) {
        first = row;
        line.limit = fmt::format("{} {} {}{}", row->quantity, row->neighbours ? "≥" : "≤", limitText(*row),
                                 row->controlled_energy_J ? " · with control" : "");
      }
      line.trouble += row->verdict == Verdict::kDiverges ? 2 : row->verdict == Verdict::kChatters ? 1 : 0;
      line.all_equal = line.all_equal && row->verdict == first->verdict && cellText(*row) == cellText(*first);
    }
  }
  std::stable_sort(lines.begin(), lines.end(),
                   [](const CaseLine& a, const CaseLine& b) { return a.trouble > b.trouble; });
  return lines;
}

// Index into the colours of stability.gp: 0 not applicable, 1 stable, 2 chatters, 3 diverges, 4 stable like
// all others.
double lookOf(const CaseLine& line, const CaseRow* row) {
  if (row == nullptr) return 0;
  if (row->verdict == Verdict::kStable) return line.all_equal ? 4 : 1;
  return row->verdict == Verdict::kChatters ? 2 : 3;
}

// Cases × models, by trouble; each cell shows its verdict and measured value.
Status drawOverview(const std::vector<CaseRow>& rows, const std::filesystem::path& out) {
  const auto lines = linesOf(rows);
  const auto models = modelsOf(rows);
  PlotBlocks data;
  for (std::size_t y = 0; y < lines.size(); ++y)
    for (std::size_t x = 0; x < models.size(); ++x) {
      const CaseRow* row = lines[y].cells[x];
      data.row("cells", {static_cast<double>(x), static_cast<double>(y), lookOf(lines[y], row)},
               {row != nullptr ? cellText(*row) : ""});
    }
  for (std::size_t y = 0; y < lines.size(); ++y)
    data.row("cases", {static_cast<double>(y)}, {lines[y].title, lines[y].limit});
  for (std::size_t x = 0; x < models.size(); ++x)
    data.row("models", {static_cast<double>(x), models[x] == AxialModel::kEnhancedTrackingWall ? 1.0 : 0.0},
             {shortName(models[x])});
  const auto file = out / "stability.dat";
  RETURN_IF_ERROR(writeFileAtomically(file, viewOf(data.text())));
  return drawPlot("stability", out / "stability.png",
                  {{"data", file.string()}, {"finding", findingOf(rows)}});
}

struct HoldRow {
  const char* case_name;
  const char* title;
};
constexpr HoldRow kHolds[] = {
    {"hold_quantised", "Encoder of 30 µm, still hand"},
    {"hold_tremor_random", "Tremor, the worst of the hands"},
    {"boundary_hold", "Tip where 2 N begin after 1 N"},
};
constexpr AxialModel kHeld[] = {AxialModel::kEnhancedTrackingWall, AxialModel::kVoigt, AxialModel::kDirect};
constexpr double kShown_s = 0.4;

const CaseOutcome* heldOutcome(const std::vector<CaseOutcome>& outcomes, std::string_view case_name,
                               AxialModel model) {
  for (const CaseOutcome& one : outcomes)
    if (one.row.case_name == case_name && one.row.model == model && !one.trace.time_s.empty()) return &one;
  return nullptr;
}

// The force of the wall, Voigt and direct in the hold cases. Empty if none of these cases was run.
Status drawHolds(const std::vector<CaseOutcome>& outcomes, const std::filesystem::path& out) {
  // each curve about its own mean, from one second into its window: well after the start of the hold
  PlotTable table("panel,t_s,force_n");
  PlotBlocks data;
  bool any = false;
  for (std::size_t r = 0; r < std::size(kHolds); ++r)
    for (std::size_t c = 0; c < std::size(kHeld); ++c) {
      const CaseOutcome* outcome = heldOutcome(outcomes, kHolds[r].case_name, kHeld[c]);
      if (outcome == nullptr) continue;
      const CaseTrace& trace = outcome->trace;
      const double from = trace.from_s + 1, to = from + kShown_s;
      std::vector<std::pair<double, double>> shown;
      for (std::size_t i = 0; i < trace.time_s.size(); ++i)
        if (trace.time_s[i] >= from && trace.time_s[i] < to)
          shown.emplace_back(trace.time_s[i] - from, trace.force_N[i]);
      if (shown.empty()) continue;
      any = true;
      const auto panel = static_cast<double>(r * 10 + c);
      double mean = 0, swing = 0;
      for (const auto& point : shown) mean += point.second / static_cast<double>(shown.size());
      for (const auto& [t, force] : shown) {
        swing = std::max(swing, std::abs(force - mean));
        table.row({panel, t, force - mean});
      }
      const Verdict verdict = outcome->row.verdict;
      data.row(
          "panels",
          {panel, static_cast<double>(r), static_cast<double>(c), verdict == Verdict::kStable ? 1.0 : 0.0},
          {kHolds[r].title, fmt::format("{}: {}, ± {} N about {} N", shortName(kHeld[c]),
                                        verdictText(verdict), shortNumber(swing), shortNumber(mean))});
    }
  if (!any) return {};
  const auto csv = out / "stability-holds.csv";
  RETURN_IF_ERROR(writeFileAtomically(csv, viewOf(table.take())));
  if (!hasGnuplot()) return {};
  const auto file = out / "stability-holds.dat";
  RETURN_IF_ERROR(writeFileAtomically(file, viewOf(data.text())));
  return drawPlot("stability-holds", out / "stability-holds.png",
                  {{"csv", csv.string()}, {"data", file.string()}, {"shown_s", kShown_s}});
}

// Draws the rows' pictures and, if all cases were run, the stiffness study, which has its own runs.
Status draw(const std::vector<CaseOutcome>& outcomes, const CaseSettings& settings,
            const StabilityOptions& options, Progress& progress) {
  std::vector<CaseRow> rows;
  for (const CaseOutcome& one : outcomes) rows.push_back(one.row);
  RETURN_IF_ERROR(drawHolds(outcomes, options.out));
  if (hasGnuplot()) {
    RETURN_IF_ERROR(drawOverview(rows, options.out));
  } else {
    std::fprintf(stderr,
                 "needlelab-sim stability: gnuplot is not on the PATH: no pictures (Debian: gnuplot-nox)\n");
  }
  if (!options.only_cases.empty()) return {};
  const auto limits = drawStiffnessLimits(options.out, settings, [&](std::string_view doing, double share) {
    progress.show(fmt::format("{:3.0f} % {}", 100 * share, doing));
  });
  progress.clear();
  if (!limits.ok()) return limits.error();
  for (const std::string& note : limits->notes)
    std::fprintf(stderr, "needlelab-sim stability: %s\n", note.c_str());
  return {};
}

int ofDevice(const StabilityOptions& options, const CaseFile& cases) {
  const auto study = studyDevice(options.device, cases, options.long_form);
  if (!study.ok()) return failed("stability", study.error());
  if (!options.json.wanted || !options.json.file.empty()) std::fputs(deviceText(*study).c_str(), stdout);
  Status status;
  if (options.json.wanted) status = writeJson(options.json, deviceJson(*study));
  if (status.ok() && !options.out.empty()) status = drawDevice(*study, options.out);
  return status.ok() ? kExitDone : failed("stability", status.error());
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
  const std::vector<std::string> names = {"stability.dat",        "stability.png",
                                          "stability-holds.csv",  "stability-holds.dat",
                                          "stability-holds.png",  "stiffness_limits.json",
                                          "stiffness_limits.csv", "stiffness_limits.png",
                                          "device.dat",           "device.png"};
  if (const Status status = checkFolderOutputs({{"--cases", options.cases}, {"--device", options.device}},
                                               {"--out", options.out}, names, options.json);
      !status.ok())
    return failed("stability", status.error());

  if (!options.device.empty()) return ofDevice(options, *file);

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

  // the shipped model must be stable; others need not be
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
      "folder for pictures, and for the largest stable stiffness per model; created if missing");
  command->add_option("--case", options->only_cases, "only this case; may be given several times")
      ->take_all();
  command->add_option("--model", options->only_models, "only this axial model; may be given several times")
      ->take_all();
  command->add_option("--cases", options->cases, "a cases.json instead of the compiled-in one");
  command->add_option(
      "--device", options->device,
      "instead of the cases, your own device (a JSON file) in each patient: how often a light "
      "grip rests, and the stiffest safe scene");
  command->add_flag("--long", options->long_form, "the long form: more hands, more gestures");
  command->callback([options, &chosen] { chosen = [options] { return stability(*options); }; });
}

}  // namespace needlelab

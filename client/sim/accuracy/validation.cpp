#include <fmt/core.h>

#include <map>
#include <system_error>
#include <utility>

#include "client/sim/accuracy/hold.h"
#include "client/sim/accuracy/study.h"
#include "client/sim/benchmark/fitted_model.h"
#include "client/sim/benchmark/training.h"
#include "client/sim/curves/baseline.h"

namespace needlelab {
namespace {

constexpr char kHoldFile[] = "insert_hold_withdraw.csv";

AccuracyRow rowOf(std::string scene, std::string model, std::string variant, bool line) {
  AccuracyRow row;
  row.comparator = Comparator::kValidation;
  row.scene = std::move(scene);
  row.model = std::move(model);
  row.variant = std::move(variant);
  row.line = line;
  row.against = "the measured force, by means over 0.25 mm or 0.05 to 0.1 s, on what was held out";
  return row;
}

// Mean of model − recorded over a bin's rows, as the bin's error.
void addBin(const CurveBin& bin, const std::vector<double>& model, ForceError& error) {
  double said = 0;
  for (const std::size_t row : bin.rows) said += model[row] / static_cast<double>(bin.rows.size());
  error.add(said, bin.value);
}

// Even and odd blocks, held out in turn.
using Halves = std::vector<ForceError>;
std::string sceneOf(HoldOut what) {
  return what == HoldOut::kEnd      ? "insertion: all beyond half of the depth"
         : what == HoldOut::kBlocks ? "insertion: every second 0.5 mm"
                                    : fmt::format("insertion: each {} in turn", nameOf(what));
}

// Baselines through the bins that are fitted on.
Halves baselineHalves(const TimeCurve& curve, Baseline baseline) {
  Halves halves(2);
  for (const int half : {0, 1}) {
    std::vector<CurveBin> through;
    for (const CurveBin& bin : curve.bins)
      if (bin.block % 2 != half) through.push_back(bin);
    if (through.empty()) continue;
    for (const CurveBin& bin : curve.bins)
      if (bin.block % 2 == half)
        halves[static_cast<std::size_t>(half)].add(baselineAt(baseline, through, bin.at), bin.value);
  }
  return halves;
}

void addHalf(const TimeCurve& curve, const std::vector<double>& model, int half, Halves& halves) {
  for (const CurveBin& bin : curve.bins)
    if (bin.block % 2 == half) addBin(bin, model, halves[static_cast<std::size_t>(half)]);
}

Result<AccuracyRows> holdRows(const std::filesystem::path& file) {
  ASSIGN_OR_RETURN(const auto recorded, readForceOverTime(file));
  const TimeCurve hold = holdOf(recorded), out = withdrawalOf(recorded);
  const std::string hold_scene = "hold of 7.6 s: every second 0.5 s";
  const std::string out_scene = "withdrawal: every second 0.1 s";
  const std::string model(axialModelName(AxialModel::kEnhancedTrackingWall));
  AccuracyRows rows;
  for (const Baseline baseline : kBaselines) {
    rows.push_back(rowOf(hold_scene, std::string(nameOf(baseline)), "", true));
    setError(rows.back(), baselineHalves(hold, baseline));
  }
  for (const StopMode mode : {StopMode::kExponential, StopMode::kRamp}) {
    Halves halves(2);
    for (const int half : {0, 1}) {
      ASSIGN_OR_RETURN(const auto fit,
                       fitHold(recorded, mode, [half](int block) { return block % 2 != half; }));
      addHalf(hold, modelAt(hold, fit.gesture, fit.run, fit.from_s), half, halves);
    }
    rows.push_back(
        rowOf(hold_scene, model, mode == StopMode::kExponential ? "exponential stop" : "ramp", false));
    setError(rows.back(), halves);
  }
  for (const Baseline baseline : kBaselines) {
    rows.push_back(rowOf(out_scene, std::string(nameOf(baseline)), "", true));
    setError(rows.back(), baselineHalves(out, baseline));
  }
  ASSIGN_OR_RETURN(const auto whole, fitHold(recorded, StopMode::kExponential, [](int) { return true; }));
  Halves halves(2);
  for (const int half : {0, 1}) {
    ASSIGN_OR_RETURN(const auto fit,
                     fitWithdrawal(recorded, whole, [half](int block) { return block % 2 != half; }));
    addHalf(out, modelAt(out, fit.gesture, fit.run, fit.from_s), half, halves);
  }
  rows.push_back(rowOf(out_scene, model, "one attracted force", false));
  setError(rows.back(), halves);
  for (AccuracyRow& row : rows)
    row.cannot_show =
        "other holds and specimens: this is one. Its displacement is not known, so the withdrawal's wall "
        "stiffness and speed act as one number";
  return rows;
}

}  // namespace

Result<AccuracyRows> insertionRows(const CurveSet& set, const AccuracyProgress& progress) {
  const std::vector<BinnedCurve> curves = binnedCurves(set);
  AccuracyRows rows;
  for (const HoldOut what : kHoldOuts) {
    const std::vector<Fold> folds = foldsOf(what, curves);
    // by the model's position in the list, which is the same in every fold
    std::vector<std::vector<ForceError>> errors;
    std::vector<AccuracyRow> of_question;
    for (const Fold& fold : folds) {
      ASSIGN_OR_RETURN(const auto models,
                       fitModels(trainingSet(curves, fold), kEqualNumbers, [&](std::string_view model) {
                         progress(fmt::format("{}: fitting {}", nameOf(what), model), 0);
                       }));
      errors.resize(models.size());
      of_question.resize(models.size());
      for (std::size_t m = 0; m < models.size(); ++m) {
        const FittedModel& model = models[m];
        if (!model.fault.empty()) continue;
        of_question[m] = rowOf(sceneOf(what), model.name, model.variant, !isModel(model.kind));
        for (const std::size_t c : fold.curves) {
          const BinnedCurve& curve = curves[c];
          ForceError error;
          ASSIGN_OR_RETURN(const auto force_N, model.forces(curve.kind, curve.curve.depth_m));
          for (const CurveBin& bin : curve.curve.bins)
            if (!fold.fit_on(c, bin)) addBin(bin, force_N, error);
          if (error.count() > 0) errors[m].push_back(error);
        }
      }
    }
    for (std::size_t m = 0; m < of_question.size(); ++m) {
      if (errors[m].empty()) continue;
      setError(of_question[m], errors[m]);
      of_question[m].cannot_show = fmt::format(
          "other tissue than that of the set ({}; insertions: {}): what predicts an unseen specimen needs "
          "several (needlelab-sim benchmark). At most {} numbers a model; baselines have one for each bin",
          set.name, curves.size(), kEqualNumbers);
      rows.push_back(std::move(of_question[m]));
    }
  }
  return rows;
}

Result<AccuracyRows> validationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& notes) {
  const auto folder = options.data / "needle_force";
  std::error_code unreadable;  // treat as missing
  if (options.data.empty() || !std::filesystem::is_directory(folder, unreadable)) {
    notes.push_back("validation: " + folder.string() +
                    " does not exist: set NEEDLELAB_DATA (or --data) to the folder that holds needle_force");
    return AccuracyRows{};
  }
  ASSIGN_OR_RETURN(const auto set, readCurveSet(folder));
  ASSIGN_OR_RETURN(auto rows, insertionRows(set, progress));
  if (std::filesystem::is_regular_file(folder / kHoldFile, unreadable)) {
    progress("hold and withdrawal", 0.9);
    ASSIGN_OR_RETURN(const auto more, holdRows(folder / kHoldFile));
    rows.insert(rows.end(), more.begin(), more.end());
  } else {
    notes.push_back("validation: " + (folder / kHoldFile).string() +
                    " does not exist: no hold, no withdrawal");
  }
  return rows;
}

}  // namespace needlelab

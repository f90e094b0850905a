#include "client/sim/benchmark/fitted_model.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "client/sim/benchmark/formula.h"
#include "client/sim/curves/force_band.h"
#include "client/sim/stability/gestures/passivity_observer.h"
#include "client/sim/tools/small_sample.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

constexpr double kFitStep_m = 3e-5;    // per tick, an eighth of a bin
constexpr double kMaxFitTicks = 3000;  // per insertion: deeper ones use longer steps
constexpr double kFitRate_hz = 100;    // for models that ignore speed
constexpr int kStatisticalInsertions = 20;

using Forces = std::vector<double>;

double rateFor(double speed_mps, double step_m) {
  return std::clamp(speed_mps / step_m, kMinRateHz, kMaxRateHz);
}

std::vector<double> depthsOf(const PooledBins& pooled) {
  std::vector<double> depth_m;
  for (const CurveBin& bin : pooled.bins) depth_m.push_back(bin.at);
  return depth_m;
}

// Sum of squares between a model and the single curves' bins of one kind.
double squaresOf(const PooledBins& pooled, const Forces& force_N) {
  double sum = 0;
  for (std::size_t i = 0; i < pooled.bins.size(); ++i)
    sum += pooled.counts[i] * std::pow(force_N[i] - pooled.bins[i].value, 2) + pooled.squares[i];
  return sum;
}

double countOf(const PooledBins& pooled) {
  double count = 0;
  for (const double one : pooled.counts) count += one;
  return count;
}

// Searches with the parameters' own steps and with larger ones: the first valley is not always the deepest.
std::vector<double> bestSearch(const std::function<double(const std::vector<double>&)>& cost,
                               const std::vector<FitParameter>& parameters) {
  FitResult best = searchAgain(cost, parameters);
  std::vector<FitParameter> wider = parameters;
  for (FitParameter& parameter : wider) parameter.step *= 4;
  FitResult other = searchAgain(cost, wider);
  return other.cost < best.cost ? std::move(other.values) : std::move(best.values);
}

// Computes a model's error on the data that it was fitted on.
Status addFitError(const TrainingSet& training, FittedModel& model) {
  double squares = 0, count = 0;
  for (const PooledBins& kind : training.kinds) {
    ASSIGN_OR_RETURN(const auto force_N, model.forces(kind.kind, depthsOf(kind)));
    squares += squaresOf(kind, force_N);
    count += countOf(kind);
  }
  model.fit_error_N = std::sqrt(squares / count);
  const double left = count - static_cast<double>(model.parameters);
  model.spread_N = left > 0 ? std::sqrt(squares / left) : 0;
  if (!model.limits)
    model.limits = [half_N = kNormal975 * model.spread_N](double, double force_N) {
      return ForceLimits{force_N - half_N, force_N + half_N};
    };
  return {};
}

// Straight lines through bins; zero force without bins.
FittedModel dotsModel(const char* name, ModelKind kind, const char* variant, std::vector<CurveBin> through) {
  FittedModel model;
  model.name = name;
  model.kind = kind;
  model.variant = variant;
  model.parameters = through.size();
  const auto at = [bins = std::move(through)](const std::vector<double>& depth_m) {
    Forces force_N;
    for (const double d : depth_m)
      force_N.push_back(bins.empty() ? 0 : baselineAt(Baseline::kConnectTheDots, bins, d));
    return force_N;
  };
  model.forces = [at](const InsertionKind&, const std::vector<double>& depth_m) -> Result<Forces> {
    return at(depth_m);
  };
  // Ignores phases: at rest as where it came to rest, on the way out as on the way in.
  model.afterwards = [at](const ForceCurve& curve) -> Result<Afterwards> {
    return Afterwards{at(Forces(curve.hold.t_s.size(), curve.hold.depth_m)), at(curve.withdrawal.depth_m)};
  };
  return model;
}

std::vector<FittedModel> baselines(const TrainingSet& training) {
  const auto& bins = training.all.bins;
  return {dotsModel("CONNECT_THE_DOTS", ModelKind::kFloor, "straight lines through the means of the curves",
                    bins),
          dotsModel("HOLD_THE_LAST", ModelKind::kTrivial, "the last force, everywhere", {bins.back()}),
          dotsModel("MEAN_FORCE", ModelKind::kTrivial, "the mean force, everywhere", rebinned(bins, 1)),
          dotsModel("NO_FORCE", ModelKind::kTrivial, "0 N", {})};
}

FittedModel formulaModel(const Formula& formula, const TrainingSet& training) {
  const auto cost = [&](const std::vector<double>& values) {
    double squares = 0, count = 0;
    for (const PooledBins& kind : training.kinds) {
      squares += squaresOf(kind, formula.forces(values, kind.kind, depthsOf(kind)));
      count += countOf(kind);
    }
    return std::sqrt(squares / count);
  };
  FittedModel model;
  model.name = formula.name;
  model.variant = formula.variant;
  model.kind = ModelKind::kFormula;
  model.parameters = formula.parameters.size();
  model.forces = [values = bestSearch(cost, formula.parameters), law = formula.forces](
                     const InsertionKind& kind, const std::vector<double>& depth_m) -> Result<Forces> {
    return law(values, kind, depth_m);
  };
  return model;
}

double fitStep_m(const TrainingSet& training) {
  return std::max(kFitStep_m, training.to_m / kMaxFitTicks);
}

// The engine's force at depths, for an insertion at that speed.
Result<Forces> engineForces(const CurveScene& scene, double speed_mps, double step_m,
                            const std::vector<double>& depth_m) {
  ASSIGN_OR_RETURN(const auto run, runCurve(scene, depth_m.back(), rateFor(speed_mps, step_m), speed_mps));
  return forceAtDepths(run, scene.surface_m, depth_m);
}

// In at one speed, at rest as long as recorded, out at another: a gesture of the tip below the surface.
Result<Afterwards> engineAfterwards(const CurveScene& scene, const ForceCurve& curve, double in_mps,
                                    double out_mps, double step_m) {
  constexpr double kMostTicks = 1e6;  // after the way in
  const CurveHold& hold = curve.hold;
  const CurveWithdrawal& out = curve.withdrawal;
  double deepest_m = std::max(curve.depth_m.back(), hold.depth_m);
  if (!out.depth_m.empty()) deepest_m = std::max(deepest_m, out.depth_m.back());
  const double hold_s = hold.t_s.empty() ? 0 : hold.t_s.back();
  const double after_s = hold_s + (out.depth_m.empty() ? 0 : (deepest_m - scene.surface_m) / out_mps);
  const double rate_hz =
      std::clamp(std::min(in_mps / step_m, kMostTicks / std::max(1.0, after_s)), kMinRateHz, kMaxRateHz);
  StraightGesture gesture = constantSpeed(
      -0.5 * in_mps / rate_hz, std::max(deepest_m - scene.surface_m, in_mps / rate_hz), in_mps, rate_hz);
  const auto in_ticks = static_cast<double>(gesture.depth_m.size() - 1);
  const double end_m = gesture.depth_m.back(), out_m = out_mps / rate_hz;
  const double hold_ticks = std::ceil(hold_s * rate_hz);
  gesture.depth_m.insert(gesture.depth_m.end(), static_cast<std::size_t>(hold_ticks), end_m);
  if (!out.depth_m.empty())
    for (double depth_m = end_m - out_m; depth_m > -out_m; depth_m -= out_m)
      gesture.depth_m.push_back(depth_m);
  ASSIGN_OR_RETURN(const auto run, runStraight(scene.spec, gesture));
  Afterwards said;
  for (const double t_s : hold.t_s) said.hold_N.push_back(forceAtTick(run, in_ticks + t_s * rate_hz));
  for (const double depth_m : out.depth_m)
    said.out_N.push_back(
        forceAtTick(run, in_ticks + hold_ticks + (end_m + scene.surface_m - depth_m) / out_m));
  return said;
}

FittedModel engineModel(const CurveModel& curve_model, const TrainingSet& training) {
  // A damper or viscous friction depends on speed; for the others any kind will do.
  const bool feels_speed = axialEntry(curve_model.model).feels_speed;
  const std::vector<PooledBins> merged = {training.all};
  const std::vector<PooledBins>& kinds = feels_speed ? training.kinds : merged;
  const double step_m = fitStep_m(training);
  const auto speedOf = [feels_speed, step_m](const InsertionKind& kind) {
    return feels_speed ? kind.speed_mps : kFitRate_hz * step_m;
  };
  std::vector<std::vector<double>> depths_m;
  for (const PooledBins& kind : kinds) depths_m.push_back(depthsOf(kind));
  const auto cost = [&](const std::vector<double>& values) {
    const CurveScene scene = curve_model.scene(values);
    double squares = 0, count = 0;
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      const auto force_N = engineForces(scene, speedOf(kinds[i].kind), step_m, depths_m[i]);
      if (!force_N.ok()) return std::numeric_limits<double>::infinity();
      squares += squaresOf(kinds[i], *force_N);
      count += countOf(kinds[i]);
    }
    return std::sqrt(squares / count);
  };
  FittedModel model;
  model.name = axialModelName(curve_model.model);
  model.variant = curve_model.variant;
  model.kind = ModelKind::kEngine;
  model.parameters = curve_model.numbers();
  model.scene = curve_model.scene(bestSearch(cost, curve_model.parameters));
  model.forces = [scene = *model.scene, speedOf, step_m](const InsertionKind& kind,
                                                         const std::vector<double>& depth_m) {
    return engineForces(scene, speedOf(kind), 0.1 * step_m, depth_m);
  };
  model.afterwards = [scene = *model.scene, speedOf, step_m](const ForceCurve& curve) {
    return engineAfterwards(scene, curve, speedOf({curve.speed_mps, 0}),
                            speedOf({curve.withdrawal.speed_mps, 0}), 0.1 * step_m);
  };
  return model;
}

// Standard deviation of the single curves about the table, within a millimetre of each row.
StatisticalSpec spreadAbout(const PooledBins& pooled, const CurveScene& table, const Forces& table_N) {
  constexpr double kMin_N = 0.005;
  const auto& rows = table.spec.precomputed.table;
  const double reach_m = rows.size() > 1 ? std::max(0.001, 0.5 * rows[1].depth_m) : 1;
  StatisticalSpec spec;
  spec.seed = 1;
  for (const auto& row : rows) {
    double squares = 0, count = 0;
    for (std::size_t i = 0; i < pooled.bins.size(); ++i) {
      if (std::fabs(pooled.bins[i].at - row.depth_m) > reach_m) continue;
      squares += pooled.counts[i] * std::pow(table_N[i] - pooled.bins[i].value, 2) + pooled.squares[i];
      count += pooled.counts[i];
    }
    const double mean_N = std::max(kMin_N, row.cutting_N);
    const double sd_N = count > 0 ? std::sqrt(squares / count) : 0;
    // a spread above the mean would only make the log-normal tail heavier
    spec.table.push_back({row.depth_m, mean_N, std::clamp(sd_N, kMin_N, mean_N)});
  }
  return spec;
}

// A table with half as many rows, each with mean and standard deviation; its force is the mean of many
// insertions.
FittedModel statisticalModel(const TrainingSet& training, std::size_t max_numbers) {
  FittedModel model;
  model.name = axialModelName(AxialModel::kStatistical);
  const CurveModel table = tableModel(training.all.bins, std::max<std::size_t>(2, max_numbers / 2));
  const FittedModel fitted = engineModel(table, training);
  const auto table_N = fitted.forces(training.all.kind, depthsOf(training.all));
  if (!table_N.ok()) {
    model.fault = table_N.error().message;
    return model;
  }
  const StatisticalSpec spec = spreadAbout(training.all, *fitted.scene, *table_N);
  model.variant = fmt::format("mean and sd of {} rows", spec.table.size());
  model.kind = ModelKind::kEngine;
  model.parameters = 2 * spec.table.size();
  model.scene = *fitted.scene;
  model.scene->spec.axial_model = AxialModel::kStatistical;
  model.scene->spec.precomputed = {};
  model.scene->spec.statistical = spec;
  model.forces = [scene = *model.scene, step_m = fitStep_m(training)](
                     const InsertionKind&, const std::vector<double>& depth_m) -> Result<Forces> {
    Forces mean_N(depth_m.size(), 0);
    CurveScene drawn = scene;
    for (int i = 0; i < kStatisticalInsertions; ++i) {
      drawn.spec.statistical.seed = scene.spec.statistical.seed + static_cast<std::uint64_t>(i);
      ASSIGN_OR_RETURN(const auto force_N, engineForces(drawn, kFitRate_hz * step_m, 0.1 * step_m, depth_m));
      for (std::size_t k = 0; k < mean_N.size(); ++k) mean_N[k] += force_N[k] / kStatisticalInsertions;
    }
    return mean_N;
  };
  model.limits = [spec](double depth_m, double) {
    const ForceLaw law = forceLawAt(spec, depth_m);
    const ForceBand band = centralBand95(law.mean_N, law.sd_N);
    return ForceLimits{band.low_N, band.high_N};
  };
  return model;
}

}  // namespace

std::string_view nameOf(ModelKind kind) {
  constexpr std::array<std::string_view, 4> kNames = {"noise floor", "trivial", "formula", "engine"};
  return kNames[static_cast<std::size_t>(kind)];
}

Result<std::vector<FittedModel>> fitModels(const TrainingSet& training, std::size_t max_numbers,
                                           const FitProgress& progress) {
  if (training.all.bins.empty()) return Error{ErrorCode::kInvalidInput, "no bins to fit on"};
  const auto say = [&](std::string_view model) {
    if (progress) progress(model);
  };
  std::vector<FittedModel> models;
  for (FittedModel& model : baselines(training)) models.push_back(std::move(model));
  for (const Formula& formula :
       {rateDependentFracture(training, max_numbers), gordonExponential(training, max_numbers)}) {
    say(formula.name);
    models.push_back(formulaModel(formula, training));
  }
  for (const CurveModel& model : curveModels(training.all.bins, max_numbers)) {
    say(axialModelName(model.model));
    models.push_back(engineModel(model, training));
  }
  say(axialModelName(AxialModel::kStatistical));
  models.push_back(statisticalModel(training, max_numbers));
  for (FittedModel& model : models) {
    if (!model.fault.empty()) continue;
    if (const Status status = addFitError(training, model); !status.ok())
      model.fault = status.error().message;
  }
  return models;
}

Result<double> energyGiven_J(const CurveScene& scene, double to_m) {
  constexpr double kRate_hz = 1000, kSpeed_mps = 0.02, kStroke_m = 0.001;
  constexpr Quat kDown{1, 0, 0, 0};
  ASSIGN_OR_RETURN(const auto model, compile(scene.spec, kRate_hz));
  PassivityObserver observer(model.axial_stiffness_N_per_m);
  SimState state{};
  StepReport report;
  const double deepest_m = std::max(to_m - scene.surface_m, 3 * kStroke_m), step_m = kSpeed_mps / kRate_hz;
  double depth_m = -step_m;
  const auto moveTo = [&](double goal_m) {
    const int ticks = std::max(1, static_cast<int>(std::ceil(std::fabs(goal_m - depth_m) / step_m)));
    const double from_m = depth_m;
    for (int i = 1; i <= ticks; ++i) {
      depth_m = from_m + (goal_m - from_m) * i / ticks;
      const TipSample tip{{0, 0, -depth_m}, kDown};
      step(model, tip, state, report);
      observer.add(tip, report, 1);
    }
  };
  for (const double part : {1.0 / 3, 2.0 / 3, 1.0}) {
    moveTo(part * deepest_m);
    for (int stroke = 0; stroke < 3; ++stroke) {
      moveTo(part * deepest_m - kStroke_m);
      moveTo(part * deepest_m);
    }
  }
  moveTo(-step_m);
  return judgedEnergy_J(observer.record());
}

Result<double> tickTime_ns(const CurveScene& scene, double to_m) {
  constexpr double kRate_hz = 1000;
  ASSIGN_OR_RETURN(const auto model, compile(scene.spec, kRate_hz));
  ASSIGN_OR_RETURN(const auto run, runCurve(scene, to_m, kRate_hz));
  return hotTickTime_ns(model, run.gesture);
}

}  // namespace needlelab

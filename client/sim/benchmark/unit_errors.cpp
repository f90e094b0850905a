#include "client/sim/benchmark/unit_errors.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/curves/force_band.h"
#include "client/sim/tools/small_sample.h"

namespace needlelab {
namespace {

constexpr double kHoldBins = 20;

// Bins with the means of the predictions at their rows.
PredictedBins predictedBins(const std::vector<CurveBin>& bins, const std::vector<double>& force_N) {
  PredictedBins said;
  for (const CurveBin& bin : bins) {
    double sum_N = 0;
    for (const std::size_t row : bin.rows) sum_N += force_N[row];
    said.push_back({bin.at, bin.value, sum_N / static_cast<double>(bin.rows.size())});
  }
  return said;
}

double squaresOf(const PredictedBins& bins, double factor) {
  double squares = 0;
  for (const PredictedBin& bin : bins) squares += std::pow(factor * bin.predicted_N - bin.value_N, 2);
  return squares;
}

// Verdict about a band, from the units if there are enough, otherwise from the blocks of the curve itself.
std::string bandText(const Tally& tally, double share) {
  std::vector<double> shares;
  std::size_t bins = 0;
  for (const auto& [name, sum] : tally.units) {
    shares.push_back(static_cast<double>(sum.inside) / static_cast<double>(sum.bins));
    bins += sum.bins;
  }
  const auto bins_per_block = static_cast<std::size_t>(std::lround(kDepthBlock_m / kDepthBin_m));
  const BandVerdict of_blocks = bandVerdict(share, std::max<std::size_t>(1, bins / bins_per_block));
  if (shares.size() < kMinUnits) return of_blocks.text;
  const MeanInterval of_units = meanInterval(shares);
  const char* found = of_units.high < 0.95                          ? "MISSED: too narrow"
                      : of_units.low > 0.95 && of_blocks.low > 0.95 ? "MISSED: too wide"
                                                                    : "kept";
  return fmt::format("{}, {:.0f} % inside ({:.0f} to {:.0f} %)", found, 100 * of_units.mean,
                     100 * std::max(0.0, of_units.low), 100 * std::min(1.0, of_units.high));
}

}  // namespace

Result<std::vector<PredictedBins>> predictionsOf(const std::vector<BinnedCurve>& curves, const Fold& fold,
                                                 const FittedModel& model) {
  std::vector<PredictedBins> said;
  for (const std::size_t i : fold.curves) {
    std::vector<CurveBin> held_out;
    for (const CurveBin& bin : curves[i].curve.bins)
      if (!fold.fit_on(i, bin)) held_out.push_back(bin);
    said.emplace_back();
    if (held_out.empty()) continue;
    ASSIGN_OR_RETURN(const auto force_N, model.forces(curves[i].kind, curves[i].curve.depth_m));
    said.back() = predictedBins(held_out, force_N);
  }
  return said;
}

Result<PredictedBins> predictHoldOrWithdrawal(HoldOut what, const FittedModel& model,
                                              const ForceCurve& curve) {
  const bool holds = what == HoldOut::kHold;
  const std::vector<double>& at = holds ? curve.hold.t_s : curve.withdrawal.depth_m;
  if (at.empty()) return PredictedBins();
  if (!model.afterwards) return Error{ErrorCode::kInvalidInput, "it knows the way in only"};
  ASSIGN_OR_RETURN(const auto after, model.afterwards(curve));
  const double width = holds ? at.back() / kHoldBins : kDepthBin_m;
  return predictedBins(binned(at, holds ? curve.hold.force_N : curve.withdrawal.force_N, width, width),
                       holds ? after.hold_N : after.out_N);
}

std::pair<PredictedBins, PredictedBins> cutAt(const PredictedBins& bins, double at_m) {
  const auto cut =
      std::find_if(bins.begin(), bins.end(), [at_m](const PredictedBin& bin) { return bin.at >= at_m; });
  return {PredictedBins(bins.begin(), cut), PredictedBins(cut, bins.end())};
}

double factorOf(const PredictedBins& bins) {
  constexpr double kLeast = 0.2, kMost = 5, kNothing_N2 = 1e-12;
  double both = 0, said = 0;
  for (const PredictedBin& bin : bins) {
    both += bin.predicted_N * bin.value_N;
    said += bin.predicted_N * bin.predicted_N;
  }
  return said > kNothing_N2 ? std::clamp(both / said, kLeast, kMost) : 1;
}

std::string unitOf(HoldOut what, const ForceCurve& curve) {
  std::string unit = fmt::format("{}, {}, {} m/s", curve.tissue, curve.specimen, numberText(curve.speed_mps));
  if (what == HoldOut::kNeedle) unit += ", " + curve.needle;
  return unit;
}

void Tally::addFold(const FittedModel& model) {
  name = model.name;
  variant = model.variant;
  kind = model.kind;
  parameters = std::max(parameters, model.parameters);
  fit_error_N += model.fit_error_N;
  ++folds;
}

void Tally::add(const std::string& unit, const PredictedBins& bins, double factor,
                const std::function<ForceLimits(double depth_m, double force_N)>& limits) {
  if (bins.empty()) return;
  if (kind == ModelKind::kTrivial && squaresOf(bins, 1) < squaresOf(bins, factor)) factor = 1;
  UnitSum& sum = units[unit];
  sum.squares += squaresOf(bins, factor);
  sum.bins += bins.size();
  for (const PredictedBin& bin : bins) {
    max_error_N = std::max(max_error_N, std::fabs(factor * bin.predicted_N - bin.value_N));
    if (!limits) continue;
    const ForceLimits within = limits(bin.at, bin.predicted_N);
    if (bin.value_N >= within.low_N && bin.value_N <= within.high_N) ++sum.inside;
  }
}

BenchmarkRow rowOf(HoldOut what, const Tally& tally) {
  BenchmarkRow row;
  row.what = what;
  row.model = tally.name;
  row.variant = tally.variant;
  row.kind = tally.kind;
  row.parameters = tally.parameters;
  row.units = tally.units.size();
  std::size_t bins = 0, inside = 0;
  for (const auto& [name, sum] : tally.units) {
    row.unit_errors_N.push_back(std::sqrt(sum.squares / static_cast<double>(sum.bins)));
    bins += sum.bins;
    inside += sum.inside;
  }
  const MeanInterval error = meanInterval(row.unit_errors_N);
  row.error_N = error.mean;
  if (error.count > 1) {
    row.error_low_N = std::max(0.0, error.low);
    row.error_high_N = error.high;
  }
  row.max_error_N = tally.max_error_N;
  row.fit_error_N = tally.fit_error_N / static_cast<double>(tally.folds);
  if (asksForPhase(what) || (holdsSpecimensOut(what) && what != HoldOut::kSpecimen)) return row;
  row.in_band = static_cast<double>(inside) / static_cast<double>(bins);
  row.band = bandText(tally, *row.in_band);
  return row;
}

}  // namespace needlelab

#include "client/sim/benchmark/training.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace needlelab {
namespace {

// Bins of several curves, by position in the grid.
class Pool {
 public:
  void add(const CurveBin& bin) {
    const double part_m = bin.at - bin.block * kDepthBlock_m;
    const int per_block = static_cast<int>(std::lround(kDepthBlock_m / kDepthBin_m));
    Cell& cell =
        cells_[bin.block * per_block + std::clamp(static_cast<int>(part_m / kDepthBin_m), 0, per_block - 1)];
    ++cell.count;
    const auto n = static_cast<double>(cell.count);
    cell.block = bin.block;
    cell.at += (bin.at - cell.at) / n;
    const double off = bin.value - cell.value;  // Welford: avoids differences of large sums
    cell.value += off / n;
    cell.squares += off * (bin.value - cell.value);
  }
  [[nodiscard]] PooledBins bins(InsertionKind kind) const {
    PooledBins pooled;
    pooled.kind = kind;
    for (const auto& [place, cell] : cells_) {
      CurveBin bin;
      bin.at = cell.at;
      bin.value = cell.value;
      bin.block = cell.block;
      pooled.bins.push_back(std::move(bin));
      pooled.counts.push_back(static_cast<double>(cell.count));
      pooled.squares.push_back(cell.squares);
    }
    return pooled;
  }

 private:
  struct Cell {
    std::size_t count = 0;
    int block = 0;
    double at = 0, value = 0, squares = 0;
  };
  std::map<int, Cell> cells_;
};

struct Words {
  std::string_view name, asks, predicted;
};
const Words& wordsOf(HoldOut what) {
  static constexpr std::array<Words, kHoldOuts.size()> kWords = {{
      {"specimen", "each specimen held out: the force in a specimen that no model has seen",
       "an unseen specimen"},
      {"specimen-start",
       "each specimen held out: a factor from the first millimetres of each of its insertions, judged on the "
       "rest of "
       "that insertion",
       "the rest of an insertion in a new specimen"},
      {"specimen-insertion", "each specimen held out: a factor from one of its insertions, judged on another",
       "a new specimen with one insertion known"},
      {"needle", "each needle held out: the force on a needle that no model has seen", "an unseen needle"},
      {"speed", "each speed held out: the force at a speed that no model has seen", "an unseen speed"},
      {"hold", "fitted on insertions: the force at rest behind them", "the hold"},
      {"withdrawal", "fitted on insertions: the force on the way out", "the withdrawal"},
      {"end", "the deeper half held out: what lies ahead where no needle has been (extrapolation)", ""},
      {"blocks", "every second 0.5 mm held out: how closely a model can be bent to a curve (interpolation)",
       ""},
  }};
  return kWords[static_cast<std::size_t>(what)];
}

double medianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[(values.size() - 1) / 2];
}

// How held-out insertions differ from the others.
std::string valueOf(HoldOut what, const BinnedCurve& curve) {
  switch (what) {
    case HoldOut::kSpecimen:
    case HoldOut::kSpecimenStart:
    case HoldOut::kSpecimenInsertion:
      return curve.source->specimen;
    case HoldOut::kNeedle:
      return curve.source->needle;
    case HoldOut::kSpeed:
      return numberText(curve.kind.speed_mps) + " m/s";
    default:
      return {};
  }
}

std::vector<Fold> foldsOfTissue(HoldOut what, const std::string& tissue, const std::vector<std::size_t>& own,
                                const std::vector<BinnedCurve>& curves) {
  std::vector<Fold> folds;
  if (what == HoldOut::kBlocks) {
    for (const int half : {0, 1})
      folds.push_back({fmt::format("{}, {} blocks", tissue, half == 0 ? "even" : "odd"), own,
                       [half](std::size_t, const CurveBin& bin) { return alternateBlocks(half)(bin); }});
    return folds;
  }
  if (what == HoldOut::kEnd) {
    double first_m = kCurveDepth_m.max, last_m = kCurveDepth_m.min;
    for (const std::size_t i : own) {
      first_m = std::min(first_m, curves[i].curve.depth_m.front());
      last_m = std::max(last_m, curves[i].curve.depth_m.back());
    }
    const double split_m = 0.5 * (first_m + last_m);
    folds.push_back({fmt::format("{}, beyond {:.3g} mm", tissue, split_m * 1e3), own,
                     [split_m](std::size_t, const CurveBin& bin) { return bin.at < split_m; }});
    return folds;
  }
  if (asksForPhase(what)) {
    folds.push_back({tissue + ", all insertions", own, [](std::size_t, const CurveBin&) { return true; }});
    return folds;
  }
  std::set<std::string> values;
  for (const std::size_t i : own) values.insert(valueOf(what, curves[i]));
  if (values.size() < 2) return folds;
  for (const std::string& value : values) {
    std::set<std::size_t> held_out;
    for (const std::size_t i : own)
      if (valueOf(what, curves[i]) == value) held_out.insert(i);
    folds.push_back(
        {fmt::format("{}, {} {}", tissue, holdsSpecimensOut(what) ? "specimen" : nameOf(what), value), own,
         [held_out](std::size_t curve, const CurveBin&) { return held_out.count(curve) == 0; }});
  }
  return folds;
}

}  // namespace

std::vector<BinnedCurve> binnedCurves(const CurveSet& set) {
  std::vector<BinnedCurve> all;
  for (const ForceCurve& curve : set.curves) {
    BinnedCurve one{&curve, {curve.speed_mps, curve.diameter_m}, {curve.depth_m, curve.force_N, {}}};
    one.curve.bins = binned(curve.depth_m, curve.force_N, kDepthBin_m, kDepthBlock_m);
    all.push_back(std::move(one));
  }
  return all;
}

std::string_view nameOf(HoldOut what) {
  return wordsOf(what).name;
}

std::string_view questionOf(HoldOut what) {
  return wordsOf(what).asks;
}

std::string_view predictedIn(HoldOut what) {
  return wordsOf(what).predicted;
}

std::vector<Fold> foldsOf(HoldOut what, const std::vector<BinnedCurve>& curves) {
  std::map<std::string, std::vector<std::size_t>> tissues;
  for (std::size_t i = 0; i < curves.size(); ++i) tissues[curves[i].source->tissue].push_back(i);
  std::vector<Fold> folds;
  for (const auto& [tissue, own] : tissues)
    for (Fold& fold : foldsOfTissue(what, tissue, own, curves)) folds.push_back(std::move(fold));
  return folds;
}

TrainingSet trainingSet(const std::vector<BinnedCurve>& curves, const Fold& fold) {
  TrainingSet training;
  Pool all;
  std::vector<std::pair<InsertionKind, Pool>> kinds;
  std::vector<double> speeds, diameters;
  for (const std::size_t i : fold.curves) {
    const BinnedCurve& curve = curves[i];
    training.to_m = std::max(training.to_m, curve.curve.depth_m.back());
    bool takes_part = false;
    Pool* own = nullptr;
    for (auto& [kind, pool] : kinds)
      if (kind == curve.kind) own = &pool;
    for (const CurveBin& bin : curve.curve.bins) {
      if (!fold.fit_on(i, bin)) continue;
      if (own == nullptr) own = &kinds.emplace_back(curve.kind, Pool()).second;
      own->add(bin);
      all.add(bin);
      takes_part = true;
    }
    if (!takes_part) continue;
    speeds.push_back(curve.kind.speed_mps);
    diameters.push_back(curve.kind.diameter_m);
  }
  if (speeds.empty()) return training;
  for (const auto& [kind, pool] : kinds) training.kinds.push_back(pool.bins(kind));
  training.all = all.bins({medianOf(speeds), medianOf(diameters)});
  training.diameters = *std::min_element(diameters.begin(), diameters.end()) > 0;
  return training;
}

}  // namespace needlelab

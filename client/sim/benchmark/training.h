/// Force curves by bins: which are fitted on and which are held out, and what a model sees of the first.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/benchmark/curve_set.h"
#include "client/sim/curves/depth_curve.h"

namespace needlelab {

/// What is known of an insertion before its force is.
struct InsertionKind {
  double speed_mps = 0;
  double diameter_m = 0;  ///< 0: not known
  friend bool operator==(const InsertionKind&, const InsertionKind&) = default;
};

/// A curve of the set with its bins (kDepthBin_m, kDepthBlock_m).
struct BinnedCurve {
  const ForceCurve* source = nullptr;
  InsertionKind kind;
  DepthCurve curve;
};
/// The set must outlive them.
std::vector<BinnedCurve> binnedCurves(const CurveSet& set);

/// Insertions of one kind: their bins' means at each place of the grid, each curve with the same weight.
struct PooledBins {
  InsertionKind kind;
  std::vector<CurveBin> bins;   ///< in order of depth; `rows` empty
  std::vector<double> counts;   ///< curves that each bin is of
  std::vector<double> squares;  ///< of the curves' bins about the mean
};

/// All that a model is fitted on.
struct TrainingSet {
  std::vector<PooledBins> kinds;
  PooledBins all;          ///< whatever the kind; its `kind` is the reference
  double to_m = 0;         ///< greatest depth of any curve, held out or not: known before its force is
  bool diameters = false;  ///< every curve has one
};

/// A way to hold out: the curves and bins to fit on. A curve is named by its place in the list.
struct Fold {
  std::string held_out;             ///< for a person, e.g. "specimen 3"
  std::vector<std::size_t> curves;  ///< all that take part: of one tissue
  std::function<bool(std::size_t curve, const CurveBin& bin)> fit_on;
};

/// A question to the data: what is held out, and what may be calibrated.
enum class HoldOut : std::uint8_t {
  kSpecimen,           ///< a specimen: zero-shot
  kSpecimenStart,      ///< the same, but its first millimetres give the model a common factor
  kSpecimenInsertion,  ///< the same, but another of its insertions gives the factor
  kNeedle,
  kSpeed,
  kHold,        ///< the force at rest behind an insertion
  kWithdrawal,  ///< and on the way out
  kEnd,
  kBlocks,
};
inline constexpr std::array<HoldOut, 9> kHoldOuts = {
    HoldOut::kSpecimen,   HoldOut::kSpecimenStart, HoldOut::kSpecimenInsertion,
    HoldOut::kNeedle,     HoldOut::kSpeed,         HoldOut::kHold,
    HoldOut::kWithdrawal, HoldOut::kEnd,           HoldOut::kBlocks};
/// "specimen", "specimen-start", "specimen-insertion", "needle", "speed", "hold", "withdrawal", "end",
/// "blocks".
std::string_view nameOf(HoldOut what);
/// What it asks, for a person.
std::string_view questionOf(HoldOut what);
/// "an unseen specimen", …: what a model that is named there predicts. Empty for end and blocks, where the
/// held-out rows are of insertions that were fitted on.
std::string_view predictedIn(HoldOut what);
constexpr bool holdsSpecimensOut(HoldOut what) {
  return what == HoldOut::kSpecimen || what == HoldOut::kSpecimenStart || what == HoldOut::kSpecimenInsertion;
}
constexpr bool asksForPhase(HoldOut what) {
  return what == HoldOut::kHold || what == HoldOut::kWithdrawal;
}

/// The folds of a question, tissue by tissue: a tissue's own curves are fitted on and held out. A tissue that
/// has only one specimen (needle, speed) has none for it.
/// - blocks: every second 0.5 mm of all curves, both halves in turn;
/// - end: all beyond half of the depth that any curve of the tissue reaches;
/// - specimen (each of the three), needle, speed: all curves of one of them, each in turn;
/// - hold, withdrawal: all insertions are fitted on, what comes behind them is held out.
std::vector<Fold> foldsOf(HoldOut what, const std::vector<BinnedCurve>& curves);

/// Pools what the fold is fitted on. Must not be empty.
TrainingSet trainingSet(const std::vector<BinnedCurve>& curves, const Fold& fold);

}  // namespace needlelab

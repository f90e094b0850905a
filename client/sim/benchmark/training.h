/// Force curves in bins: which are fitted on, which are held out, and what a model sees of the former.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/curves/depth_curve.h"
#include "common/curves/curve_set.h"

namespace needlelab {

/// The facts of an insertion that are known before its force.
struct InsertionKind {
  double speed_mps = 0;
  double diameter_m = 0;  ///< 0 if unknown
  friend bool operator==(const InsertionKind&, const InsertionKind&) = default;
};

/// A curve of the set with its bins (kDepthBin_m, kDepthBlock_m).
struct BinnedCurve {
  const ForceCurve* source = nullptr;
  InsertionKind kind;
  DepthCurve curve;
};
/// The set must outlive the result.
std::vector<BinnedCurve> binnedCurves(const CurveSet& set);

/// Insertions of one kind: means of their bins at each position of the grid, all curves equally weighted.
struct PooledBins {
  InsertionKind kind;
  std::vector<CurveBin> bins;   ///< ordered by depth; `rows` empty
  std::vector<double> counts;   ///< number of curves in each bin
  std::vector<double> squares;  ///< of the curves' bins about the mean
};

/// All the data that a model is fitted on.
struct TrainingSet {
  std::vector<PooledBins> kinds;
  PooledBins all;          ///< of any kind; its `kind` is the reference
  double to_m = 0;         ///< greatest depth of any curve, held out or not, because it is known before the
                           ///< force
  bool diameters = false;  ///< all curves have one
};

/// One way of holding out: the curves and bins to fit on. Curves are identified by their index.
struct Fold {
  std::string held_out;             ///< for people, e.g. "specimen 3"
  std::vector<std::size_t> curves;  ///< all that take part; from one tissue
  std::function<bool(std::size_t curve, const CurveBin& bin)> fit_on;
};

/// A question to the data: the insertions held out, and those for calibration.
enum class HoldOut : std::uint8_t {
  kSpecimen,           ///< a specimen: zero-shot
  kSpecimenStart,      ///< the same, with a common factor from its first millimetres
  kSpecimenInsertion,  ///< the same, with the factor from another of its insertions
  kNeedle,
  kSpeed,
  kHold,        ///< the force at rest after an insertion
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
/// The question in words, for people.
std::string_view questionOf(HoldOut what);
/// "an unseen specimen", …: what a model named there predicts. Empty for end and blocks, where the held-out
/// rows belong to insertions that were fitted on.
std::string_view predictedIn(HoldOut what);
constexpr bool holdsSpecimensOut(HoldOut what) {
  return what == HoldOut::kSpecimen || what == HoldOut::kSpecimenStart || what == HoldOut::kSpecimenInsertion;
}
constexpr bool asksForPhase(HoldOut what) {
  return what == HoldOut::kHold || what == HoldOut::kWithdrawal;
}

/// The folds of a question, tissue by tissue: only a tissue's own curves are fitted on and held out. A tissue
/// with only one specimen (needle, speed) has no folds for it.
/// - blocks: every second 0.5 mm of all curves, both halves in turn;
/// - end: everything beyond half of the greatest depth of the tissue's curves;
/// - specimen (each of the three), needle, speed: all curves of one of them, each in turn;
/// - hold, withdrawal: fitted on all insertions; what follows them is held out.
std::vector<Fold> foldsOf(HoldOut what, const std::vector<BinnedCurve>& curves);

/// Pools the data that the fold is fitted on. Must not be empty.
TrainingSet trainingSet(const std::vector<BinnedCurve>& curves, const Fold& fold);

}  // namespace needlelab

/// Bands of expert gestures, and the comparison of a gesture with them.
///
/// A few experts are a small sample: below `kLeastForZScore` gestures there is no z-score and no percentile,
/// only the range. "Like the experts" means within the 95 % prediction interval of one more gesture from the
/// same normal distribution, mean ± t(0.975, n−1)·sd·√(1 + 1/n), which is wide for small n; it needs no
/// assumption about the population's true spread. The sd of a comparison is never below the measure's least
/// difference (measure_table.h), so that experts who are alike do not make everybody else a stranger.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/scoring/dtw.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/measures.h"

namespace needlelab {

inline constexpr std::size_t kLeastForZScore = 5;
/// Beyond so many standard deviations, people read "far from the experts".
inline constexpr double kFarFromExperts = 3;

/// A measure over reference gestures; gestures without the measure are left out.
struct ReferenceBand {
  std::string name, unit;
  std::size_t n = 0;  ///< at least 1
  double mean = 0;
  double sd = 0;  ///< sample standard deviation (n − 1); 0 for n = 1
  double least = 0, greatest = 0, median = 0;
  std::optional<double> p10, p25, p75, p90;  ///< interpolated between ranks; from kLeastForZScore on
};

/// Returns the bands in the order of measureKinds(), layers by number.
std::vector<ReferenceBand> referenceBands(std::span<const std::vector<Measure>> gestures);

/// Returns the band of these values (at least one; values that are not finite are left out).
ReferenceBand bandOf(std::string name, std::string unit, std::span<const double> values);

/// Returns the distance of each reference from the nearest other reference: the scale for a gesture's
/// `dtw_distance_m`. Empty for fewer than two references.
std::vector<double> distancesAmong(std::span<const TipPath> references);
/// The distance of two references by their places in the list, in m; nothing: one of both has no path.
using DistanceBetween = std::function<std::optional<double>(std::size_t, std::size_t)>;
/// The same of so many references, for a caller that knows distances: asks once for each pair.
std::vector<double> distancesAmong(std::size_t references, const DistanceBetween& between);

enum class Standing : std::uint8_t {
  kLikeReference,  ///< within the expected range of another expert's gesture
  kBetter,         ///< outside that range, on the better side, in an attempt that did not fail
  kWorse,
  kDifferent,  ///< outside that range, and not better or worse
  kTooFew,     ///< fewer than kLeastForZScore references
};
/// "like_reference", "better", "worse", "different", "too_few".
std::string_view standingName(Standing standing);

struct Comparison {
  std::string name, unit;
  double value = 0;
  ReferenceBand band;
  /// (value − mean)/max(sd, least difference); empty: too few, or yes-or-no and all references alike. For
  /// computers, not for people.
  std::optional<double> z;
  Standing standing = Standing::kTooFew;
  std::string words;  ///< one sentence
};

/// Compares each measured row that has a band, in the rows' order. `passed`: the attempt's verdict, if it has
/// one; nothing is called better than the experts in an attempt that was not passed. `layer_names`: of the
/// session's profile, for the words.
std::vector<Comparison> compareWithReference(std::span<const Measure> measures,
                                             std::span<const ReferenceBand> bands, std::optional<bool> passed,
                                             std::span<const std::string> layer_names = {});

/// t(0.975, df), the quantile of Student's distribution, to 0.3 %; df at least 1.
double studentQuantile975(std::size_t df);

/// A list of {"measure", "unit", "n", "mean", "sd", "least", "p10", "p25", "median", "p75", "p90",
/// "greatest"}; percentiles are null if n is too small for them, sd if n = 1.
std::string bandsJson(std::span<const ReferenceBand> bands);
/// A list of {"measure", "value", "unit", "n", "mean", "sd", "z", "better", "standing", "words"}.
std::string comparisonJson(std::span<const Comparison> comparisons);

}  // namespace needlelab

/// Bands of expert gestures, and where a gesture lies in them.
///
/// The experts' range is from the least to the greatest value of at least `kMinReferences` gestures. It
/// assumes no distribution: one more gesture of the same experts lies in it with probability (n − 1)/(n + 1),
/// 67 % for n = 5 and 95 % for n = 39 (Wilks, "Determination of sample sizes for setting tolerance limits",
/// Ann. Math. Statist. 12, 1941). There is no range for fewer gestures, or if the experts do not vary.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/motion/dtw.h"

namespace needlelab {

inline constexpr std::size_t kMinReferences = 5;

/// A measure over reference gestures; gestures without the measure are omitted.
struct ReferenceBand {
  std::string name, unit;
  std::size_t n = 0;  ///< at least 1
  double mean = 0;
  double sd = 0;  ///< sample standard deviation (n − 1); 0 for n = 1
  double least = 0, greatest = 0, median = 0;
  std::optional<double> p10, p25, p75, p90;  ///< interpolated between ranks; for n ≥ kMinReferences
};

/// Returns the bands in the order of measureKinds(), layers by number.
std::vector<ReferenceBand> referenceBands(std::span<const std::vector<Measure>> gestures);

/// Returns the band of these values (at least one; values that are not finite are omitted).
ReferenceBand bandOf(std::string name, std::string unit, std::span<const double> values);

/// Returns the distance of each reference from the nearest other reference: the scale for a gesture's
/// `dtw_distance_m`. Empty for fewer than two references.
std::vector<double> distancesAmong(std::span<const TipPath> references);
/// Returns the distance in m between two references, given by their indices; nothing if either has no path.
using DistanceBetween = std::function<std::optional<double>(std::size_t, std::size_t)>;
/// The same for `references` references whose distances the caller knows: calls `between` once for each pair.
std::vector<double> distancesAmong(std::size_t references, const DistanceBetween& between);

/// The range that a gesture is compared with, in the measure's unit, including its ends.
struct ExpertRange {
  double least = 0, greatest = 0;
};
/// Returns the experts' range; nothing if there are fewer than kMinReferences, if they do not vary (least
/// and greatest read the same), or if the measure is yes or no.
std::optional<ExpertRange> expertRange(const ReferenceBand& band);

enum class ExpertPlace : std::uint8_t { kBelow, kWithin, kAbove };
/// "below", "within", "above".
std::string_view placeName(ExpertPlace place);
/// Returns where a value lies in the experts' range, or nothing if there is no range. All texts and pictures
/// use this.
std::optional<ExpertPlace> placeAmong(const ReferenceBand& band, double value);

/// Where the ends of the range and the value lie in a picture, from 0 (left) to 1; every picture of a
/// comparison uses these, so that it matches the words. A tenth of the width is free at each side.
struct PlaceMarks {
  double least = 0, greatest = 0, value = 0;
};
PlaceMarks placeMarks(const ExpertRange& range, double value);

/// A measure compared with the experts.
struct Comparison {
  std::string name, unit;
  double value = 0;
  std::size_t n = 0;  ///< number of reference gestures
  double least = 0, greatest = 0;
  std::optional<ExpertPlace> place;
  /// "Peak force 3.2 N: above the experts' range, 1.9 N to 2.6 N (6 gestures)"; empty without a place.
  std::string words;
};

/// Compares each measured row that has a band, in the rows' order. `layer_names`: the session profile's, for
/// the words.
std::vector<Comparison> compareWithReference(std::span<const Measure> measures,
                                             std::span<const ReferenceBand> bands,
                                             std::span<const std::string> layer_names = {});

/// Returns why a gesture with these measures cannot be a reference: "touched 1 hazard", "2 contacts with
/// bone"; empty if it can. Such a gesture would not be an example, and would widen the experts' range.
std::string whyNoReference(std::span<const Measure> measures);

/// A list of {"measure", "unit", "n", "mean", "sd", "least", "p10", "p25", "median", "p75", "p90",
/// "greatest"}; percentiles are null if n is too small for them, sd if n = 1.
std::string bandsJson(std::span<const ReferenceBand> bands);
/// A list of {"measure", "value", "unit", "n", "least", "greatest", "place", "better", "words"}; place is
/// null if there is no range.
std::string comparisonJson(std::span<const Comparison> comparisons);

}  // namespace needlelab

/// Bands of expert gestures, and the place of a gesture in them.
///
/// The experts' range goes from the least to the greatest value of at least `kLeastReferences` gestures. It
/// needs no assumption about how values are distributed: one more gesture of the same experts lies in it with
/// probability (n − 1)/(n + 1), 67 % for n = 5 and 95 % for n = 39 (Wilks, "Determination of sample sizes for
/// setting tolerance limits", Ann. Math. Statist. 12, 1941). Of fewer gestures, and where the experts do not
/// vary, nothing is said.
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

inline constexpr std::size_t kLeastReferences = 5;

/// A measure over reference gestures; gestures without the measure are left out.
struct ReferenceBand {
  std::string name, unit;
  std::size_t n = 0;  ///< at least 1
  double mean = 0;
  double sd = 0;  ///< sample standard deviation (n − 1); 0 for n = 1
  double least = 0, greatest = 0, median = 0;
  std::optional<double> p10, p25, p75, p90;  ///< interpolated between ranks; from kLeastReferences on
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

/// The range that a gesture is compared with, in the measure's unit. Its ends belong to it.
struct ExpertRange {
  double least = 0, greatest = 0;
};
/// Returns the range of the experts. Nothing: fewer than kLeastReferences, they do not vary (least and
/// greatest read the same), or the measure is yes or no.
std::optional<ExpertRange> expertRange(const ReferenceBand& band);

enum class ExpertPlace : std::uint8_t { kBelow, kWithin, kAbove };
/// "below", "within", "above".
std::string_view placeName(ExpertPlace place);
/// Returns where a value lies in the experts' range: words and pictures of all programs are made from it.
/// Nothing: there is no range.
std::optional<ExpertPlace> placeAmong(const ReferenceBand& band, double value);

/// Where the ends of the range and the value lie in a picture, from 0 (left) to 1: each picture of a
/// comparison draws these, so that it shows what the words say. A tenth of the width is free at each side.
struct PlaceMarks {
  double least = 0, greatest = 0, value = 0;
};
PlaceMarks placeMarks(const ExpertRange& range, double value);

/// A measure beside the experts.
struct Comparison {
  std::string name, unit;
  double value = 0;
  std::size_t n = 0;  ///< of the reference gestures
  double least = 0, greatest = 0;
  std::optional<ExpertPlace> place;
  /// "Peak force 3.2 N: above the experts' range, 1.9 N to 2.6 N (6 gestures)"; empty without a place.
  std::string words;
};

/// Compares each measured row that has a band, in the rows' order. `layer_names`: of the session's profile,
/// for the words.
std::vector<Comparison> compareWithReference(std::span<const Measure> measures,
                                             std::span<const ReferenceBand> bands,
                                             std::span<const std::string> layer_names = {});

/// Returns why a gesture with these measures cannot be a reference: "touched 1 hazard", "2 contacts with
/// bone"; empty if it can. It would be no example, and would widen the experts' range.
std::string whyNoReference(std::span<const Measure> measures);

/// A list of {"measure", "unit", "n", "mean", "sd", "least", "p10", "p25", "median", "p75", "p90",
/// "greatest"}; percentiles are null if n is too small for them, sd if n = 1.
std::string bandsJson(std::span<const ReferenceBand> bands);
/// A list of {"measure", "value", "unit", "n", "least", "greatest", "place", "better", "words"}; place is
/// null where nothing is said.
std::string comparisonJson(std::span<const Comparison> comparisons);

}  // namespace needlelab

/// How measures go over the attempts of one person at one exercise.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/scoring/measures.h"

namespace needlelab {

/// With fewer attempts nothing is said about a trend: no order of three is rarer than 1 in 6.
inline constexpr std::size_t kLeastForTrend = 4;
/// With fewer attempts no curve of three parameters is fitted.
inline constexpr std::size_t kLeastForCurve = 8;

/// Whether values rise or fall with the attempts, without asking for a line or a distribution.
struct Trend {
  double slope_per_attempt = 0;  ///< Theil–Sen: median of the slopes between all pairs
  double tau = 0;                ///< Kendall's: −1 always falling … 1 always rising
  /// Two-sided, of the Mann–Kendall test: exact without ties up to 50 attempts, else by its normal
  /// approximation with correction for ties and continuity. No correction for several measures looked at.
  double p = 1;
};

/// y(k) = end + gain·exp(−(k − 1)/attempts) over the attempts k = 1, 2, …: least squares.
struct LearningCurve {
  double end = 0;       ///< what it tends to
  double gain = 0;      ///< what the first attempt has beyond that
  double attempts = 0;  ///< after so many, all but 1/e of the gain is gone
  double r_squared = 0;
};

struct MeasureProgress {
  std::string name, unit;
  std::vector<std::size_t> attempts;  ///< which ones had the measure, from 0
  std::vector<double> values;         ///< of those
  std::optional<Trend> trend;
  std::optional<LearningCurve> curve;
  std::string words;  ///< whether it became better, and why there is no curve
};

/// Empty for fewer than kLeastForTrend finite values.
std::optional<Trend> trendOf(std::span<const double> values);

/// Empty, with the reason in `why`, unless there are kLeastForCurve values, the curve describes them better
/// than a constant and than a straight line (corrected Akaike criterion lower by 2 at least), and its bend
/// lies within the attempts seen (0.5 attempts up to all of them): what flattens out only later is not known.
std::optional<LearningCurve> learningCurveOf(std::span<const double> values, std::string* why = nullptr);

/// One entry for each measure that an attempt has, in the order of measureKinds(). `attempts` in time.
std::vector<MeasureProgress> progressOf(std::span<const std::vector<Measure>> attempts);

/// A list of {"measure", "unit", "better", "attempts", "values", "trend", "curve", "words"}; trend and curve
/// are null where there is none.
std::string progressJson(std::span<const MeasureProgress> progress);

}  // namespace needlelab

/// The trend of measures over one person's attempts at one exercise.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/scoring/measures/measures.h"

namespace needlelab {

/// The minimum number of attempts for a trend: with three, no order is rarer than 1 in 6.
inline constexpr std::size_t kMinForTrend = 4;
/// The minimum number of attempts for a curve with three parameters.
inline constexpr std::size_t kMinForCurve = 8;

/// The trend of values over attempts; assumes neither a line nor a distribution.
struct Trend {
  double slope_per_attempt = 0;  ///< Theil–Sen: median of the slopes between all pairs
  double tau = 0;                ///< Kendall's τ: −1 always falling … 1 always rising
  /// Two-sided p of the Mann–Kendall test: exact without ties up to 50 attempts, otherwise the normal
  /// approximation corrected for ties and continuity. Not corrected for testing several measures.
  double p = 1;
};

/// Least-squares fit of y(k) = end + gain·exp(−(k − 1)/attempts) over the attempts k = 1, 2, …
struct LearningCurve {
  double end = 0;       ///< the limit
  double gain = 0;      ///< the first attempt's difference from the limit
  double attempts = 0;  ///< number of attempts after which only 1/e of the gain remains
  double r_squared = 0;
};

struct MeasureProgress {
  std::string name, unit;
  std::vector<std::size_t> attempts;  ///< indices of the attempts with the measure, from 0
  std::vector<double> values;         ///< values of these attempts
  std::optional<Trend> trend;
  std::optional<LearningCurve> curve;
  std::string words;  ///< states whether the measure became better, and why there is no curve
};

/// Empty for fewer than kMinForTrend finite values.
std::optional<Trend> trendOf(std::span<const double> values);

/// Empty, with the reason in `why`, unless there are kMinForCurve values, the curve fits better than a
/// constant and a straight line (corrected Akaike criterion lower by at least 2), and its bend lies within
/// the observed attempts (from 0.5 attempts up to all of them): a later bend would be a guess.
std::optional<LearningCurve> learningCurveOf(std::span<const double> values, std::string* why = nullptr);

/// Returns one entry for each measure that an attempt has, in the order of measureKinds(). `attempts` are in
/// order of time and preceded by `before` others.
std::vector<MeasureProgress> progressOf(std::span<const std::vector<Measure>> attempts,
                                        std::size_t before = 0);

/// A list of {"measure", "unit", "better", "attempts", "values", "trend", "curve", "words"}; trend and curve
/// may be null.
std::string progressJson(std::span<const MeasureProgress> progress);

}  // namespace needlelab

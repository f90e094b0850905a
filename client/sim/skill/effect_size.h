/// Effect size between two small groups, and its significance by permutation.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "client/device/hand/hand.h"

namespace needlelab {

/// Cliff's delta: P(b > a) − P(b < a) over all pairs; −1 … 1. Both groups need at least one value.
double cliffsDelta(std::span<const double> a, std::span<const double> b);

/// Hedges' g: (mean b − mean a) over the pooled standard deviation, times 1 − 3/(4 (n_a + n_b) − 9), which
/// removes the small-sample bias (Hedges 1981). 0 if the means are equal, ±infinity if only the spread is 0.
/// Both groups need at least two values.
double hedgesG(std::span<const double> a, std::span<const double> b);

struct Interval {
  double low = 0, high = 0;
};
/// 95 % percentile bootstrap of g: `resamples` draws with replacement within each group. Resamples without
/// spread are redrawn. For groups as small as six the interval is too narrow; it shows the spread and is not
/// a test.
Interval bootstrapG(std::span<const double> a, std::span<const double> b, std::size_t resamples,
                    HandRandom& random);

/// Permutation test of |Cliff's delta|: the share of all labellings that separate the values at least as far.
/// Exact up to 20,000 labellings (12 values in halves: 924); otherwise from 20,000 random ones, plus the
/// given one.
class LabelTest {
 public:
  /// `first`: size of the first group; from 1 to one less than all.
  LabelTest(std::vector<double> values, std::size_t first, HandRandom& random);
  /// `is_first[i]`: whether value i is labelled as in the first group; exactly `first` are.
  [[nodiscard]] double p(const std::vector<bool>& is_first) const;
  [[nodiscard]] bool exact() const { return exact_; }

 private:
  [[nodiscard]] double distance(const std::vector<bool>& is_first) const;
  std::vector<double> ranks_;  // midranks: delta depends only on their sum in a group
  std::size_t first_ = 0;
  bool exact_ = false;
  std::vector<double> distances_;  // of all examined labellings, sorted
};

/// A random labelling with `first` of `n` in the first group, all equally likely.
std::vector<bool> randomLabels(std::size_t n, std::size_t first, HandRandom& random);

}  // namespace needlelab

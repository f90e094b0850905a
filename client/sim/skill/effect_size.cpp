#include "client/sim/skill/effect_size.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace needlelab {
namespace {

constexpr std::size_t kMaxLabellings = 20'000;

double meanOf(std::span<const double> v) {
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

double squaresOf(std::span<const double> v) {
  const double mean = meanOf(v);
  double sum = 0;
  for (const double x : v) sum += (x - mean) * (x - mean);
  return sum;
}

std::size_t indexBelow(std::size_t n, HandRandom& random) {
  return std::min(n - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(n)));
}

}  // namespace

double cliffsDelta(std::span<const double> a, std::span<const double> b) {
  double sum = 0;
  for (const double x : a) {
    for (const double y : b) sum += y > x ? 1 : y < x ? -1 : 0;
  }
  return sum / static_cast<double>(a.size() * b.size());
}

double hedgesG(std::span<const double> a, std::span<const double> b) {
  const double n = static_cast<double>(a.size() + b.size());
  const double difference = meanOf(b) - meanOf(a);
  if (difference == 0) return 0;
  const double pooled = std::sqrt((squaresOf(a) + squaresOf(b)) / (n - 2));
  if (!(pooled > 0)) return std::copysign(std::numeric_limits<double>::infinity(), difference);
  return difference / pooled * (1 - 3 / (4 * n - 9));
}

Interval bootstrapG(std::span<const double> a, std::span<const double> b, std::size_t resamples,
                    HandRandom& random) {
  std::vector<double> drawn_a(a.size()), drawn_b(b.size()), values;
  // limits the tries, because equal values would be redrawn forever
  for (std::size_t tries = 0; values.size() < resamples && tries < 2 * resamples; ++tries) {
    for (double& v : drawn_a) v = a[indexBelow(a.size(), random)];
    for (double& v : drawn_b) v = b[indexBelow(b.size(), random)];
    const double g = hedgesG(drawn_a, drawn_b);
    if (std::isfinite(g)) values.push_back(g);
  }
  if (values.empty()) {
    const double g = hedgesG(a, b);
    return {g, g};
  }
  std::sort(values.begin(), values.end());
  const auto at = [&](double p) {
    return values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1) + 0.5)];
  };
  return {at(0.025), at(0.975)};
}

std::vector<bool> randomLabels(std::size_t n, std::size_t first, HandRandom& random) {
  std::vector<bool> labels(n, false);
  // each position in turn, with its remaining probability
  std::size_t wanted = first;
  for (std::size_t i = 0; i < n; ++i) {
    if (indexBelow(n - i, random) >= wanted) continue;
    labels[i] = true;
    --wanted;
  }
  return labels;
}

LabelTest::LabelTest(std::vector<double> values, std::size_t first, HandRandom& random)
    : ranks_(values.size()), first_(first) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    double below = 0, same = 0;
    for (const double v : values) below += v < values[i], same += v == values[i];
    ranks_[i] = below + 0.5 * (same + 1);
  }
  const std::size_t n = values.size();
  double ways = 1;
  for (std::size_t k = 1; k <= first; ++k)
    ways = ways * static_cast<double>(n - first + k) / static_cast<double>(k);
  exact_ = ways <= static_cast<double>(kMaxLabellings) + 0.5;
  if (exact_) {
    std::vector<bool> labels(n, false);
    std::fill(labels.begin(), labels.begin() + static_cast<std::ptrdiff_t>(first), true);
    do distances_.push_back(distance(labels));
    while (std::prev_permutation(labels.begin(), labels.end()));
  } else {
    for (std::size_t i = 0; i < kMaxLabellings; ++i)
      distances_.push_back(distance(randomLabels(n, first, random)));
  }
  std::sort(distances_.begin(), distances_.end());
}

double LabelTest::distance(const std::vector<bool>& is_first) const {
  double sum = 0;
  for (std::size_t i = 0; i < ranks_.size(); ++i) sum += is_first[i] ? ranks_[i] : 0;
  return std::abs(sum - static_cast<double>(first_) * static_cast<double>(ranks_.size() + 1) / 2);
}

double LabelTest::p(const std::vector<bool>& is_first) const {
  const double seen = distance(is_first) - 1e-9;
  const auto as_far = distances_.end() - std::lower_bound(distances_.begin(), distances_.end(), seen);
  const double extra = exact_ ? 0 : 1;  // the actual labelling is one of the possible ones
  return (static_cast<double>(as_far) + extra) / (static_cast<double>(distances_.size()) + extra);
}

}  // namespace needlelab

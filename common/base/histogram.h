/// How often which size of a thing was seen: fixed bounds, a few hundred bytes, ready to be shown as a
/// Prometheus histogram.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace needlelab {

/// Upper bounds of the buckets, inclusive, ascending. Durations in ns, 1-2-5 from 10 µs to 10 s.
inline constexpr std::array<std::int64_t, 19> kDurationBoundsNs = {
    10'000,      20'000,        50'000,        100'000,       200'000,       500'000,     1'000'000,
    2'000'000,   5'000'000,     10'000'000,    20'000'000,    50'000'000,    100'000'000, 200'000'000,
    500'000'000, 1'000'000'000, 2'000'000'000, 5'000'000'000, 10'000'000'000};
/// Counts: powers of two from 1 to 16384.
inline constexpr std::array<std::int64_t, 15> kCountBounds = {1,   2,   4,    8,    16,   32,   64,   128,
                                                              256, 512, 1024, 2048, 4096, 8192, 16384};

/// A copy is a snapshot. `Bounds` is one of the tables above. Thread: one (or guarded by its owner).
template <const auto& Bounds>
class Histogram {
 public:
  static constexpr std::size_t kBuckets = std::size(Bounds) + 1;  ///< the last has no upper bound

  void add(std::int64_t value) {
    const auto at = std::lower_bound(std::begin(Bounds), std::end(Bounds), value);
    ++buckets_[static_cast<std::size_t>(at - std::begin(Bounds))];
    ++count_;
    sum_ += value;
    max_ = count_ == 1 ? value : std::max(max_, value);
  }

  [[nodiscard]] static constexpr std::span<const std::int64_t> bounds() { return Bounds; }
  /// In each bucket alone (Prometheus adds them up): above bounds()[i−1], at most bounds()[i].
  [[nodiscard]] const std::array<std::uint64_t, kBuckets>& buckets() const { return buckets_; }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::int64_t sum() const { return sum_; }
  [[nodiscard]] std::int64_t max() const { return max_; }

  /// The value below which the share `q` (0 … 1) lies, straight within its bucket, never above max(); 0 when
  /// nothing was added.
  [[nodiscard]] double quantile(double q) const {
    if (count_ == 0) return 0;
    const double wanted = std::clamp(q, 0.0, 1.0) * static_cast<double>(count_);
    double below = 0;
    for (std::size_t i = 0; i < kBuckets; ++i) {
      const auto here = static_cast<double>(buckets_[i]);
      if (here > 0 && below + here >= wanted) {
        const double low = i == 0 ? 0.0 : static_cast<double>(Bounds[i - 1]);
        const double high = i + 1 < kBuckets ? static_cast<double>(Bounds[i]) : static_cast<double>(max_);
        return std::min(low + (high - low) * (wanted - below) / here, static_cast<double>(max_));
      }
      below += here;
    }
    return static_cast<double>(max_);
  }

 private:
  std::array<std::uint64_t, kBuckets> buckets_{};
  std::uint64_t count_ = 0;
  std::int64_t sum_ = 0, max_ = 0;
};

using DurationHistogram = Histogram<kDurationBoundsNs>;
using CountHistogram = Histogram<kCountBounds>;

}  // namespace needlelab

/// Histograms in fixed memory: one for sizes and durations in the server's metrics, one for durations of the
/// haptic thread's ticks.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace needlelab {

/// Upper bounds of the buckets, inclusive, ascending. Durations in ns, 1-2-5 from 10 µs to 10 s.
inline constexpr std::array<std::int64_t, 19> kDurationBoundsNs = {
    10'000,      20'000,        50'000,        100'000,       200'000,       500'000,     1'000'000,
    2'000'000,   5'000'000,     10'000'000,    20'000'000,    50'000'000,    100'000'000, 200'000'000,
    500'000'000, 1'000'000'000, 2'000'000'000, 5'000'000'000, 10'000'000'000};
/// Counts: powers of two from 1 to 16384.
inline constexpr std::array<std::int64_t, 15> kCountBounds = {1,   2,   4,    8,    16,   32,   64,   128,
                                                              256, 512, 1024, 2048, 4096, 8192, 16384};

/// Counts values in buckets with fixed bounds, in a few hundred bytes; can be exported as a Prometheus
/// histogram. A copy is a snapshot. `Bounds` is one of the tables above. Thread: one (or guarded by its
/// owner).
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
  /// Counts per bucket, not cumulative (Prometheus adds them up): above bounds()[i−1], at most bounds()[i].
  [[nodiscard]] const std::array<std::uint64_t, kBuckets>& buckets() const { return buckets_; }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::int64_t sum() const { return sum_; }
  [[nodiscard]] std::int64_t max() const { return max_; }

  /// Returns the quantile `q` (0 … 1), interpolated linearly within its bucket, never above max(); 0 when the
  /// histogram is empty.
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

/// The usual quantiles of durations, in ns; zeros when the histogram is empty.
struct LatencyQuantiles {
  std::uint64_t total = 0;
  std::int64_t p50_ns = 0, p99_ns = 0, p999_ns = 0, max_ns = 0;
};

/// Counts the durations of the haptic thread's work, tick by tick. Quantiles can be read while the thread
/// runs. Durations in ns from 0 to 2^40 (18 min; longer durations count as 2^40). Exact below 64 ns; above
/// that, each bucket is 1/32 of its power of two wide, and a quantile is the upper end of its bucket: at most
/// 3.2 % too high, never too low. Thread: one thread adds, any number of threads read concurrently (readers
/// may miss the newest durations); no lock on either side. `add` is real-time safe.
class LatencyHistogram {
 public:
  LatencyHistogram() = default;
  LatencyHistogram(const LatencyHistogram& other) noexcept { *this = other; }
  LatencyHistogram& operator=(const LatencyHistogram& other) noexcept {
    for (std::size_t i = 0; i < counts_.size(); ++i)
      counts_[i].store(other.counts_[i].load(std::memory_order_relaxed), std::memory_order_relaxed);
    max_ns_.store(other.max_ns(), std::memory_order_relaxed);
    return *this;
  }

  void add(std::int64_t duration_ns) noexcept {
    // one writer, so a plain increment is enough; the atomic keeps readers from seeing half a value
    auto& count =
        counts_[bucketOf(static_cast<std::uint64_t>(std::clamp<std::int64_t>(duration_ns, 0, kLargest)))];
    count.store(count.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    if (duration_ns > max_ns_.load(std::memory_order_relaxed))
      max_ns_.store(duration_ns, std::memory_order_relaxed);
  }
  /// Adds all durations of another histogram.
  void add(const LatencyHistogram& other) noexcept {
    for (std::size_t i = 0; i < counts_.size(); ++i)
      counts_[i].store(
          counts_[i].load(std::memory_order_relaxed) + other.counts_[i].load(std::memory_order_relaxed),
          std::memory_order_relaxed);
    max_ns_.store(std::max(max_ns(), other.max_ns()), std::memory_order_relaxed);
  }
  /// Returns the durations added since `earlier`, a copy of this histogram. The maximum is that of the whole
  /// histogram: it cannot be split.
  [[nodiscard]] LatencyHistogram since(const LatencyHistogram& earlier) const noexcept {
    LatencyHistogram newer(*this);
    for (std::size_t i = 0; i < counts_.size(); ++i)
      newer.counts_[i].store(newer.counts_[i].load(std::memory_order_relaxed) -
                                 earlier.counts_[i].load(std::memory_order_relaxed),
                             std::memory_order_relaxed);
    return newer;
  }
  [[nodiscard]] std::uint64_t total() const noexcept {
    std::uint64_t sum = 0;
    for (const auto& count : counts_) sum += count.load(std::memory_order_relaxed);
    return sum;
  }
  [[nodiscard]] std::int64_t max_ns() const noexcept { return max_ns_.load(std::memory_order_relaxed); }
  /// Returns the least duration such that at least the share `q` (0-1) of all durations is not above it; 0
  /// when the histogram is empty.
  [[nodiscard]] std::int64_t quantile_ns(double q) const noexcept {
    const double wanted = q * static_cast<double>(total());
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      const std::uint64_t count = counts_[i].load(std::memory_order_relaxed);
      seen += count;
      if (count > 0 && static_cast<double>(seen) >= wanted) return std::min(upperEnd(i), max_ns());
    }
    return 0;
  }
  /// Returns all quantiles at one instant: p50 ≤ p99 ≤ p99.9 even while the writer adds.
  [[nodiscard]] LatencyQuantiles quantiles() const noexcept {
    const LatencyHistogram now(
        *this);  // 9 KiB copy: durations added between two reads would make the later quantile too low
    return {now.total(), now.quantile_ns(0.5), now.quantile_ns(0.99), now.quantile_ns(0.999), now.max_ns()};
  }

 private:
  static constexpr std::int64_t kLargest = (std::int64_t{1} << 40) - 1;
  static constexpr unsigned kSubBits = 5;  // 32 buckets to a power of two
  static constexpr std::size_t kExact = std::size_t{2} << kSubBits;

  static std::size_t bucketOf(std::uint64_t value) noexcept {
    if (value < kExact) return static_cast<std::size_t>(value);
    const auto shift = static_cast<unsigned>(std::bit_width(value)) - 1 - kSubBits;
    return (std::size_t{shift} << kSubBits) + static_cast<std::size_t>(value >> shift);
  }
  static std::int64_t upperEnd(std::size_t bucket) noexcept {
    if (bucket < kExact) return static_cast<std::int64_t>(bucket);
    const std::size_t shift = (bucket >> kSubBits) - 1;
    const std::uint64_t top = (bucket & ((1u << kSubBits) - 1)) + (1u << kSubBits);
    return static_cast<std::int64_t>(((top + 1) << shift) - 1);
  }

  std::array<std::atomic<std::uint64_t>, kExact + (std::size_t{34} << kSubBits)> counts_{};
  std::atomic<std::int64_t> max_ns_{0};
};

// --- the median of a list

/// `values` must not be empty. For an even number of values, returns the upper of the two middle ones.
template <typename T>
[[nodiscard]] T medianOf(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace needlelab

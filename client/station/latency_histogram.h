/// Counts of durations in fixed memory, for quantiles of what the haptic loop does, tick by tick.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace needlelab {

/// Durations in ns from 0 to 2^40 (18 min; longer ones count as that). Exact below 64 ns; above, buckets are
/// 1/32 of their power of two wide, and a quantile is the upper end of its bucket: at most 3.2 % too high,
/// never too low. Thread: one adds; read when it is done. `add` is real-time safe.
class LatencyHistogram {
 public:
  void add(std::int64_t duration_ns) noexcept {
    const auto value = static_cast<std::uint64_t>(std::clamp<std::int64_t>(duration_ns, 0, kLargest));
    ++counts_[bucketOf(value)];
    ++total_;
    max_ns_ = std::max(max_ns_, duration_ns);
  }
  [[nodiscard]] std::uint64_t total() const noexcept { return total_; }
  [[nodiscard]] std::int64_t max_ns() const noexcept { return max_ns_; }
  /// The least duration that at least the share `q` (0-1) of all is not above; 0 when there is none.
  [[nodiscard]] std::int64_t quantile_ns(double q) const noexcept {
    const double wanted = q * static_cast<double>(total_);
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      seen += counts_[i];
      if (counts_[i] > 0 && static_cast<double>(seen) >= wanted) return std::min(upperEnd(i), max_ns_);
    }
    return 0;
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

  std::array<std::uint64_t, kExact + (std::size_t{34} << kSubBits)> counts_{};
  std::uint64_t total_ = 0;
  std::int64_t max_ns_ = 0;
};

}  // namespace needlelab

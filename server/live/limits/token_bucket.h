/// A token bucket, and a set of buckets by account, station or address.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>

namespace needlelab {

/// `at_once` immediately, then `per_s` per second.
struct BucketRate {
  double at_once = 0, per_s = 0;
  /// The whole share is available at once and refills evenly within a day, so at most two shares can be used
  /// in a day.
  static BucketRate ofDay(double share) { return {share, share / 86'400}; }
};

/// take() fills the bucket, and it leaks. Times: ns of one clock, from the caller, never decreasing. Thread:
/// one.
struct TokenBucket {
  BucketRate rate;
  double used = 0;  ///< at `at_ns`
  std::int64_t at_ns = 0;

  [[nodiscard]] double usedAt(std::int64_t now_ns) const {
    return std::max(0.0, used - rate.per_s * 1e-9 * static_cast<double>(now_ns - at_ns));
  }
  /// Whether `amount` is left.
  [[nodiscard]] bool has(double amount, std::int64_t now_ns) const {
    return usedAt(now_ns) + amount <= rate.at_once * (1 + kRounding);
  }
  /// Takes `amount` even if it is not left; check has() first. A negative amount is given back.
  void take(double amount, std::int64_t now_ns) {
    used = std::max(0.0, usedAt(now_ns) + amount);
    at_ns = now_ns;
  }
  /// Seconds until has() is true; 0 or less if it is now.
  [[nodiscard]] double secondsUntil(double amount, std::int64_t now_ns) const {
    return (usedAt(now_ns) + amount - rate.at_once) / rate.per_s;
  }
  /// The same in whole minutes, for messages.
  [[nodiscard]] double minutesUntil(double amount, std::int64_t now_ns) const {
    return std::ceil(secondsUntil(amount, now_ns) / 60 * (1 - kRounding));
  }

 private:
  static constexpr double kRounding = 1e-9;  // of sums and products
};

/// One bucket per owner, kept across log-ins and connections. Empty buckets are dropped, so memory is bounded
/// by owners with recent use, or kLeast. Thread: one.
class TokenBuckets {
 public:
  /// Valid until the next call.
  TokenBucket& of(const std::string& owner, const BucketRate& rate, std::int64_t now_ns) {
    if (buckets_.size() >= look_at_) {
      std::erase_if(buckets_, [now_ns](const auto& entry) { return entry.second.usedAt(now_ns) == 0; });
      look_at_ = std::max(kLeast, 2 * buckets_.size());
    }
    TokenBucket& bucket = buckets_[owner];
    bucket.rate = rate;
    return bucket;
  }
  /// False: too much; then nothing is taken.
  bool take(const std::string& owner, const BucketRate& rate, double amount, std::int64_t now_ns) {
    TokenBucket& bucket = of(owner, rate, now_ns);
    if (!bucket.has(amount, now_ns)) return false;
    bucket.take(amount, now_ns);
    return true;
  }
  /// At most twice the number of non-empty buckets, or kLeast.
  [[nodiscard]] std::size_t known() const { return buckets_.size(); }

  static constexpr std::size_t kLeast = 64;

 private:
  std::size_t look_at_ = kLeast;  // the size at which empty buckets are dropped
  std::unordered_map<std::string, TokenBucket> buckets_;
};

}  // namespace needlelab

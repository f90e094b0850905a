/// How many small messages each station and each person has sent lately.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>

namespace needlelab {

/// A message fills a bucket, which leaks. Times: steady clock (ns), from the caller. Thread: one.
class MessageBucket {
 public:
  MessageBucket(double at_once, double per_s) : at_once_(at_once), per_s_(per_s) {}

  /// False: too often. What is refused fills nothing: a station that asks again for all its sessions gets on,
  /// however many it has.
  bool take(std::int64_t now_ns) {
    if (filledAt(now_ns) + 1 > at_once_) return false;
    filled_ = filledAt(now_ns) + 1;
    filled_ns_ = now_ns;
    return true;
  }
  [[nodiscard]] bool emptyAt(std::int64_t now_ns) const { return filledAt(now_ns) == 0; }

 private:
  [[nodiscard]] double filledAt(std::int64_t now_ns) const {
    return std::max(0.0, filled_ - per_s_ * 1e-9 * static_cast<double>(now_ns - filled_ns_));
  }
  const double at_once_, per_s_;
  double filled_ = 0;
  std::int64_t filled_ns_ = 0;
};

/// The buckets of those who are logged in: one for all connections of a station or a person, which does not
/// begin anew with a log-in. A bucket is forgotten once it is empty and no connection has it. Thread: one.
class MessageRates {
 public:
  MessageRates(double at_once, double per_s) : at_once_(at_once), per_s_(per_s) {}

  /// `owner`: turnNameOf (request_effects.h).
  std::shared_ptr<MessageBucket> of(const std::string& owner, std::int64_t now_ns) {
    if (buckets_.size() >= look_at_) {
      std::erase_if(buckets_, [now_ns](const auto& entry) {
        return entry.second.use_count() == 1 && entry.second->emptyAt(now_ns);
      });
      look_at_ = std::max(kLeast, 2 * buckets_.size());
    }
    auto& bucket = buckets_[owner];
    if (!bucket) bucket = std::make_shared<MessageBucket>(at_once_, per_s_);
    return bucket;
  }
  /// At most twice those that are needed, or kLeast.
  [[nodiscard]] std::size_t known() const { return buckets_.size(); }

  static constexpr std::size_t kLeast = 64;

 private:
  const double at_once_, per_s_;
  std::size_t look_at_ = kLeast;  // the size at which the empty ones go
  std::unordered_map<std::string, std::shared_ptr<MessageBucket>> buckets_;
};

}  // namespace needlelab

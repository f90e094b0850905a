/// A bounded queue that drops its oldest items.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

namespace needlelab {

/// For live data: if items arrive faster than they are taken, the newest are kept. `Item` has `bytes()`.
/// Thread: one at a time.
template <typename Item>
class DropQueue {
 public:
  DropQueue(std::size_t most_items, std::size_t most_bytes)
      : max_items_(most_items), max_bytes_(most_bytes) {}

  /// Returns how many items were dropped to make room.
  std::uint64_t push(Item item) {
    bytes_ += item.bytes();
    items_.push_back(std::move(item));
    std::uint64_t dropped = 0;
    // keep the newest even if it alone exceeds the limit
    for (; items_.size() > 1 && (items_.size() > max_items_ || bytes_ > max_bytes_); ++dropped) (void)pop();
    return dropped;
  }
  std::optional<Item> pop() {
    if (items_.empty()) return std::nullopt;
    std::optional<Item> item(std::move(items_.front()));
    items_.pop_front();
    bytes_ -= item->bytes();
    return item;
  }
  /// Returns how many items were removed.
  std::uint64_t clear() {
    const std::uint64_t count = items_.size();
    items_.clear();
    bytes_ = 0;
    return count;
  }
  [[nodiscard]] bool empty() const { return items_.empty(); }
  [[nodiscard]] std::size_t size() const { return items_.size(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  const std::size_t max_items_, max_bytes_;
  std::deque<Item> items_;
  std::size_t bytes_ = 0;
};

}  // namespace needlelab

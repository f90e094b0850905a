/// Passes data from one thread to another without waiting on either side: a ring that keeps all items, and a
/// triple buffer that keeps the newest value only.
#pragma once

#include <array>
#include <atomic>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>

namespace needlelab {

/// A wait-free ring from one producer thread to one consumer thread; a full ring rejects the item and counts
/// it. Fixed capacity (a power of two), allocated once at construction. `T` is trivially copyable. Thread:
/// `push` by the one producer, `pop` by the one consumer, `dropped` by any. Neither waits, locks or
/// allocates.
template <typename T, std::size_t Capacity>
class SpscRing {
  static_assert(std::is_trivially_copyable_v<T>);
  static_assert(Capacity >= 2 && (Capacity & (Capacity - 1)) == 0, "capacity is a power of two");

 public:
  /// Returns false and counts the item when the ring is full.
  bool push(const T& item) noexcept {
    const std::uint64_t tail = tail_.load(std::memory_order_relaxed);
    assert(cached_head_ <= tail && tail - cached_head_ <= Capacity);
    if (tail - cached_head_ == Capacity) {
      cached_head_ = head_.load(std::memory_order_acquire);
      if (tail - cached_head_ == Capacity) {
        dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
        return false;
      }
    }
    (*slots_)[tail & (Capacity - 1)] = item;
    tail_.store(tail + 1, std::memory_order_release);
    return true;
  }

  bool pop(T& item) noexcept {
    const std::uint64_t head = head_.load(std::memory_order_relaxed);
    assert(head <= cached_tail_ && cached_tail_ - head <= Capacity);
    if (head == cached_tail_) {
      cached_tail_ = tail_.load(std::memory_order_acquire);
      if (head == cached_tail_) return false;
    }
    item = (*slots_)[head & (Capacity - 1)];
    head_.store(head + 1, std::memory_order_release);
    return true;
  }

  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::unique_ptr<std::array<T, Capacity>> slots_ = std::make_unique<std::array<T, Capacity>>();
  alignas(64) std::atomic<std::uint64_t> tail_{0};
  std::uint64_t cached_head_ = 0;
  std::atomic<std::uint64_t> dropped_{0};
  alignas(64) std::atomic<std::uint64_t> head_{0};
  std::uint64_t cached_tail_ = 0;
};

/// Triple buffer: the newest value from one writer to one reader, wait-free on both sides.
/// Thread: `publish` by the one writer, `fetch` by the one reader. `T` is trivially copyable.
template <typename T>
class LatestValue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  void publish(const T& value) noexcept {
    assert(write_ < slots_.size());
    slots_[write_] = value;
    write_ = middle_.exchange(static_cast<std::uint8_t>(write_ | kFresh), std::memory_order_acq_rel) & kIndex;
  }

  /// Copies the newest value to `value`; returns false when it is not newer than the last fetch.
  bool fetch(T& value) noexcept {
    if (!(middle_.load(std::memory_order_relaxed) & kFresh)) return false;
    read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
    assert(read_ < slots_.size());
    value = slots_[read_];
    return true;
  }

 private:
  static constexpr std::uint8_t kFresh = 4, kIndex = 3;
  std::array<T, 3> slots_{};
  std::uint8_t write_ = 0;
  alignas(64) std::atomic<std::uint8_t> middle_{1};
  alignas(64) std::uint8_t read_ = 2;
};

}  // namespace needlelab

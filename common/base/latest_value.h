/// Triple buffer: the newest value from one writer to one reader, wait-free on both sides.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

namespace needlelab {

/// Thread: `publish` by the one writer, `fetch` by the one reader. `T` is trivially copyable.
template <typename T>
class LatestValue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  void publish(const T& value) noexcept {
    slots_[write_] = value;
    write_ = middle_.exchange(static_cast<std::uint8_t>(write_ | kFresh), std::memory_order_acq_rel) & kIndex;
  }

  /// True when a value newer than the last fetch was copied to `value`.
  bool fetch(T& value) noexcept {
    if (!(middle_.load(std::memory_order_relaxed) & kFresh)) return false;
    read_ = middle_.exchange(read_, std::memory_order_acq_rel) & kIndex;
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

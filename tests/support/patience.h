/// How long a test waits for something that must happen. It measures nothing: a wait that reaches it is a
/// hang.
#pragma once

#include <chrono>
#include <thread>

namespace needlelab::test {

inline constexpr std::chrono::seconds kPatience{120};

/// Waits until `condition` holds, checking every few milliseconds. Returns false after `limit`.
template <typename Condition>
bool eventually(Condition condition, std::chrono::milliseconds limit = kPatience) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

}  // namespace needlelab::test

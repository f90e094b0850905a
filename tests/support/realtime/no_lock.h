/// Watches a thread's use of locks, to test that real-time functions do not use them. Link
/// needlelab::no_lock.
#pragma once

#include <cstdint>

namespace needlelab::test {

/// During its lifetime counts this thread's calls to pthread_mutex_lock, _trylock, _timedlock, read-write and
/// spin locks, the signals of condition variables and semaphores (std::mutex and similar types call these).
/// Scopes do not nest. Does not work in sanitized builds, which replace these functions: `works` is false
/// there.
class NoLockScope {
 public:
  NoLockScope() noexcept;
  ~NoLockScope();
  NoLockScope(const NoLockScope&) = delete;
  NoLockScope& operator=(const NoLockScope&) = delete;
  /// Calls of this thread since construction.
  [[nodiscard]] std::uint64_t calls() const noexcept;
  [[nodiscard]] static bool works() noexcept;
};

}  // namespace needlelab::test

/// Watches a thread's use of the heap, to test that real-time functions do not use it. Link
/// needlelab::no_alloc.
#pragma once

#include <cstdint>

namespace needlelab::test {

/// Counts every call of this thread to malloc, calloc, realloc, aligned_alloc, free (and therefore new and
/// delete) during its lifetime. Scopes do not nest. Works in plain builds by replacing malloc, under ASan and
/// TSan through their hooks.
class NoAllocScope {
 public:
  NoAllocScope() noexcept;
  ~NoAllocScope();
  NoAllocScope(const NoAllocScope&) = delete;
  NoAllocScope& operator=(const NoAllocScope&) = delete;
  /// Heap calls of this thread since construction.
  [[nodiscard]] std::uint64_t calls() const noexcept;
};

}  // namespace needlelab::test

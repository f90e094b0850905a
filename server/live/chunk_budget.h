/// The chunks of the whole server that wait for their commit: how many, and how many bytes they hold.
#pragma once

#include <cassert>
#include <cstddef>

namespace needlelab {

/// Full from the moment when either limit is reached until both numbers have fallen to half of theirs: those
/// who wait are woken once, and not for each chunk. While it is full nobody should read another chunk; each
/// connection may have read one already, so the bytes stay below the limit plus one chunk (1 MiB) for each
/// connection. Thread: one.
class ChunkBudget {
 public:
  struct Limits {
    std::size_t chunks = 8192;       ///< less than the capacity of the writer's queue
    std::size_t bytes = 128u << 20;  ///< a chunk of a lesson has some 7 kB, a hostile one 1 MiB
  };
  explicit ChunkBudget(const Limits& limits) : limits_(limits) {}

  void add(std::size_t bytes) {
    ++chunks_;
    bytes_ += bytes;
    full_ = full_ || chunks_ >= limits_.chunks || bytes_ >= limits_.bytes;
  }
  /// Returns true when this was the chunk that ends the state full: wake those who wait.
  [[nodiscard]] bool remove(std::size_t bytes) {
    assert(chunks_ > 0 && bytes_ >= bytes);
    --chunks_;
    bytes_ -= bytes;
    if (!full_ || chunks_ > limits_.chunks / 2 || bytes_ > limits_.bytes / 2) return false;
    full_ = false;
    return true;
  }
  [[nodiscard]] bool full() const { return full_; }
  [[nodiscard]] std::size_t chunks() const { return chunks_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  const Limits limits_;
  std::size_t chunks_ = 0, bytes_ = 0;
  bool full_ = false;
};

}  // namespace needlelab

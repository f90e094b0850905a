/// The chunks that wait for their commit, of the whole server and of each station: how many, and how many
/// bytes they hold.
#pragma once

#include <cassert>
#include <cstddef>
#include <string>
#include <unordered_map>

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

  struct Part {
    std::size_t chunks = 0, bytes = 0;
  };

  void add(const std::string& station, std::size_t bytes) {
    Part& part = of_station_[station];
    ++part.chunks;
    part.bytes += bytes;
    ++chunks_;
    bytes_ += bytes;
    full_ = full_ || chunks_ >= limits_.chunks || bytes_ >= limits_.bytes;
  }
  /// Returns true when this was the chunk that ends the state full: wake those who wait.
  [[nodiscard]] bool remove(const std::string& station, std::size_t bytes) {
    const auto part = of_station_.find(station);
    assert(part != of_station_.end() && part->second.bytes >= bytes && chunks_ > 0 && bytes_ >= bytes);
    part->second.bytes -= bytes;
    if (--part->second.chunks == 0) of_station_.erase(part);
    --chunks_;
    bytes_ -= bytes;
    if (!full_ || chunks_ > limits_.chunks / 2 || bytes_ > limits_.bytes / 2) return false;
    full_ = false;
    return true;
  }
  [[nodiscard]] bool full() const { return full_; }
  /// On all its connections: those of one that is over are still in the writer's queue.
  [[nodiscard]] Part of(const std::string& station) const {
    const auto part = of_station_.find(station);
    return part == of_station_.end() ? Part{} : part->second;
  }
  [[nodiscard]] std::size_t chunks() const { return chunks_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  const Limits limits_;
  std::unordered_map<std::string, Part> of_station_;
  std::size_t chunks_ = 0, bytes_ = 0;
  bool full_ = false;
};

}  // namespace needlelab

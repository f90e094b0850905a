/// The usable samples of a recording by their number, of which only a part is decoded at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// Leaves out what `cleaned` leaves out (track.h). Samples that are all in memory stay where they are.
/// Otherwise the recording comes in blocks (a chunk each), which are decoded when they are asked for and
/// given up, the longest unused first, beyond kMostHeld samples: scoring reads a recording from end to end
/// several times, and a lesson of two minutes is decoded once. Thread: one.
class RecordedSamples {
 public:
  /// Decodes a block, the same samples each time. Its errors end up in fault().
  using Read = std::function<Result<std::vector<GestureSample>>(std::size_t block)>;

  /// Of all blocks together, some 200 bytes each; but never fewer blocks than kLeastHeld.
  static constexpr std::size_t kMostHeld = 131'072;
  /// So a reference from operator[] stays valid while those of three other places are asked for.
  static constexpr std::size_t kLeastHeld = 4;

  /// `samples` must outlive it.
  explicit RecordedSamples(std::span<const GestureSample> samples);
  /// Reads all blocks once. Errors: those of `read`.
  static Result<RecordedSamples> inBlocks(std::size_t blocks, Read read, std::size_t most_held = kMostHeld);
  /// The same block by block: without any yet.
  static RecordedSamples ofBlocks(Read read, std::size_t most_held = kMostHeld);
  /// Reads the next block for the first time; returns how many samples it has, usable or not. What was
  /// returned by operator[], front() and back() before is not valid any more. Errors: those of `read`.
  Result<std::size_t> addBlock();

  RecordedSamples(RecordedSamples&&) noexcept = default;
  RecordedSamples& operator=(RecordedSamples&&) noexcept = default;
  RecordedSamples(const RecordedSamples&) = delete;
  RecordedSamples& operator=(const RecordedSamples&) = delete;
  ~RecordedSamples() = default;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  /// `i` < size(). The reference is valid until kLeastHeld other blocks were asked for.
  const GestureSample& operator[](std::size_t i) const {
    if (i - first_ >= count_) find(i);
    return data_[i - first_];
  }
  /// Not empty; valid as long as this is not moved.
  [[nodiscard]] const GestureSample& front() const { return front_; }
  [[nodiscard]] const GestureSample& back() const { return back_; }

  /// The first error of a block that could be read at first and not again: what was computed since is wrong.
  [[nodiscard]] const Status& fault() const { return fault_; }
  /// The greatest number of decoded samples for which memory was held at once; 0 for samples in memory.
  [[nodiscard]] std::size_t mostHeld() const { return most_held_; }

 private:
  struct Block {
    std::size_t first = 0;               // its first usable sample's number
    std::uint64_t last_tick = 0;         // of the usable samples before
    bool any_before = false;             // whether there are such
    std::vector<GestureSample> samples;  // usable ones, when held
    bool held = false;
    std::list<std::size_t>::iterator place;  // in held_, when held
  };
  RecordedSamples() = default;
  [[nodiscard]] std::size_t countOf(std::size_t block) const;
  void find(std::size_t i) const;
  void hold(std::size_t block, std::vector<GestureSample> samples) const;
  void show(std::size_t block) const;

  std::size_t size_ = 0;
  GestureSample front_, back_;
  std::vector<GestureSample> storage_;  // in memory: the usable samples, when some are left out
  Read read_;
  std::size_t limit_ = kMostHeld;
  std::uint64_t last_tick_ = 0;  // of the usable samples of the blocks so far
  bool any_ = false;             // whether there are such
  mutable std::vector<Block> blocks_;
  mutable std::list<std::size_t> held_;  // numbers of the blocks that are held, the longest unused first
  mutable std::size_t held_samples_ = 0, most_held_ = 0;
  mutable Status fault_;
  // the part that was asked for last
  mutable const GestureSample* data_ = nullptr;
  mutable std::size_t first_ = 0, count_ = 0;
};

}  // namespace needlelab

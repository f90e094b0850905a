/// The usable samples of a recording, by number, of which only a part is decoded at a time; and the amount of
/// work per step of a long computation over them, so that the thread can do other work in between.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// This many distances from targets and hazards cost as much as one sample.
inline constexpr std::uint64_t kRegionsAsASample = 8;

/// The work of a step, in samples read and measured, about 0.2 µs each; other work counts as the number of
/// samples that take as long. The worker checks before each piece whether the step is over, and then reports
/// the piece's cost: a step does at least one piece, and its last one may exceed what was left.
class StepWork {
 public:
  explicit StepWork(std::uint64_t samples) : left_(std::max<std::uint64_t>(1, samples)) {}
  /// A step that ends when everything is done.
  static StepWork all() { return StepWork(UINT64_MAX); }

  [[nodiscard]] bool isOver() const { return left_ == 0; }
  void spend(std::uint64_t samples) { left_ -= std::min(left_, samples); }

 private:
  std::uint64_t left_;
};

/// Returns the usable samples: ticks strictly ascending; positions, orientations, forces and lengths finite
/// and not absurd (1 km, 1 MN). Other samples are omitted, as if their ticks had been missed. Usually all
/// samples are usable and nothing is copied: the result is `samples` itself; otherwise it is in `storage`.
std::span<const GestureSample> cleaned(std::span<const GestureSample> samples,
                                       std::vector<GestureSample>& storage);

/// As cleaned, in place, for a part of a recording. `last_tick`, `any`: the last tick of the usable samples
/// before it, and whether there are any; updated to include this part.
void keepUsable(std::vector<GestureSample>& samples, std::uint64_t& last_tick, bool& any);

/// Seconds between two ticks.
inline double secondsBetween(const GestureSample& a, const GestureSample& b, double rate_hz) {
  return static_cast<double>(b.tick - a.tick) / rate_hz;
}

/// Whether the tip was in tissue in that tick, according to the engine.
inline bool isInside(const GestureSample& sample) {
  return sample.layer >= 0;
}

/// Omits the same samples as `cleaned`. Samples that are all in memory stay where they are.
/// Otherwise the recording comes in blocks (one chunk each), which are decoded when needed; beyond kMaxHeld
/// samples, the least recently used are released. Scoring reads a recording from end to end several times,
/// and a lesson of two minutes is decoded only once. Thread: one.
class RecordedSamples {
 public:
  /// Decodes a block; must return the same samples each time. Its errors appear in fault().
  using Read = std::function<Result<std::vector<GestureSample>>(std::size_t block)>;

  /// Maximum number of samples held, about 200 bytes each, but never fewer blocks than kMinHeld.
  static constexpr std::size_t kMaxHeld = 131'072;
  /// Keeps a reference from operator[] valid while references to three other places are requested.
  static constexpr std::size_t kMinHeld = 4;

  /// `samples` must outlive it.
  explicit RecordedSamples(std::span<const GestureSample> samples);
  /// Reads all blocks once. Errors: as `read`.
  static Result<RecordedSamples> inBlocks(std::size_t blocks, Read read, std::size_t max_held = kMaxHeld);
  /// As inBlocks, but starts without blocks; call addBlock for each.
  static RecordedSamples ofBlocks(Read read, std::size_t max_held = kMaxHeld);
  /// Reads the next block for the first time; returns its number of samples, usable or not. Invalidates
  /// earlier references from operator[], front() and back(). Errors: as `read`.
  Result<std::size_t> addBlock();

  RecordedSamples(RecordedSamples&&) noexcept = default;
  RecordedSamples& operator=(RecordedSamples&&) noexcept = default;
  RecordedSamples(const RecordedSamples&) = delete;
  RecordedSamples& operator=(const RecordedSamples&) = delete;
  ~RecordedSamples() = default;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  /// `i` < size(). The reference is valid until kMinHeld other blocks have been requested.
  const GestureSample& operator[](std::size_t i) const {
    if (i - first_ >= count_) find(i);
    return data_[i - first_];
  }
  /// Must not be empty; valid as long as this object is not moved.
  [[nodiscard]] const GestureSample& front() const { return front_; }
  [[nodiscard]] const GestureSample& back() const { return back_; }

  /// The first error from a block that was readable at first but not later: everything computed since is
  /// wrong.
  [[nodiscard]] const Status& fault() const { return fault_; }
  /// The maximum number of decoded samples held in memory at once; 0 for samples in memory.
  [[nodiscard]] std::size_t mostHeld() const { return max_held_; }

 private:
  struct Block {
    std::size_t first = 0;               // its first usable sample's number
    std::uint64_t last_tick = 0;         // of the preceding usable samples
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
  std::vector<GestureSample> storage_;  // in memory: the usable samples, if some are omitted
  Read read_;
  std::size_t limit_ = kMaxHeld;
  std::uint64_t last_tick_ = 0;  // last tick of the usable samples so far
  bool any_ = false;             // whether there are such
  mutable std::vector<Block> blocks_;
  mutable std::list<std::size_t> held_;  // numbers of the held blocks, least recently used first
  mutable std::size_t held_samples_ = 0, max_held_ = 0;
  mutable Status fault_;
  // the part requested last
  mutable const GestureSample* data_ = nullptr;
  mutable std::size_t first_ = 0, count_ = 0;
};

}  // namespace needlelab

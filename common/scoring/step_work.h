/// How much of a long computation one step does, so that a thread can be given to others in between.
#pragma once

#include <algorithm>
#include <cstdint>

namespace needlelab {

/// So many distances from targets and hazards take as long as a sample.
inline constexpr std::uint64_t kRegionsAsASample = 8;

/// Counts in samples that are read and measured, some 0.2 µs each; what is not done by sample counts as what
/// takes as long. Whoever works asks before each piece whether the step is over, and says what the piece
/// cost: a step does at least one piece, and its last one may be greater than what was left.
class StepWork {
 public:
  explicit StepWork(std::uint64_t samples) : left_(std::max<std::uint64_t>(1, samples)) {}
  /// A step that is over when all is done.
  static StepWork all() { return StepWork(UINT64_MAX); }

  [[nodiscard]] bool isOver() const { return left_ == 0; }
  void spend(std::uint64_t samples) { left_ -= std::min(left_, samples); }

 private:
  std::uint64_t left_;
};

}  // namespace needlelab

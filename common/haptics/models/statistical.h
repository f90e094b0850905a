/// STATISTICAL: the variation of the force over depth between patients (FORCE_MODEL.md, "Axial models").
#pragma once

#include <cstdint>

#include "common/haptics/axial_model.h"
#include "common/haptics/models/depth_table.h"
#include "common/haptics/models/score_process.h"

namespace needlelab {

/// The target force of insertions: log-normal at each depth, with the table's mean m and sd s (times the
/// patient's factors), i.e. with σ² = ln(1 + s²/m²)
///   target = m·e^(σ z − σ²/2) = m/√(1 + s²/m²)·e^(σ z)
/// where z is the normal score of that insertion at that depth. 0 where m is 0. Const; any thread.
class StatisticalTarget {
 public:
  /// The section must be valid (see `validate`).
  explicit StatisticalTarget(const StatisticalSpec& spec);

  /// Returns the force in N. `insertion` counts from 0; `path` and `row` are caches of that insertion (start:
  /// {} and 0). Real-time safe.
  double at(std::uint64_t insertion, double depth_m, ScorePath& path, std::uint32_t& row) const noexcept;

  [[nodiscard]] const ScoreProcess& process() const { return process_; }

 private:
  DepthTable table_;  // a: mean, b: sd
  ScoreProcess process_;
  std::uint64_t seed_;
};

/// One insertion's target as a function of depth, exactly as the engine renders it; for studies and tests.
class StatisticalInsertion {
 public:
  /// `target` must outlive this object.
  StatisticalInsertion(const StatisticalTarget& target, std::uint64_t insertion)
      : target_(target), insertion_(insertion) {}
  double target_N(double depth_m) { return target_.at(insertion_, depth_m, path_, row_); }

 private:
  const StatisticalTarget& target_;
  std::uint64_t insertion_;
  ScorePath path_;
  std::uint32_t row_ = 0;
};

}  // namespace needlelab

/// A unit Ornstein-Uhlenbeck process over depth that depends only on (key, depth): depths can be evaluated in
/// any order, and only the neighbourhood of the last evaluation is kept. On nodes of a dyadic grid over 1 m
/// it is exact: the ends are drawn jointly, and each midpoint from its neighbours a and b at distance h by
/// the process's own bridge,
///   mean ρ(a + b)/(1 + ρ²), variance (1 − ρ²)/(1 + ρ²), ρ = e^(−h/length)
/// (the conditional law of a Gaussian Markov process: Rasmussen and Williams 2006, app. B). Between nodes the
/// score is linear and scaled to variance 1, so that it is a unit normal at every depth and continuous.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/haptics/sim_state.h"

namespace needlelab {

/// Const after construction; any thread.
class ScoreProcess {
 public:
  /// `length_m` > 0: the distance over which the correlation falls to 1/e.
  explicit ScoreProcess(double length_m);
  /// Returns the score at a depth (clamped to [0, 1 m]). `path` must have the same key, or cell −1. Real-time
  /// safe: at most 18 normal draws, 2 on average when the tip enters the next cell, none within a cell.
  double at(std::uint64_t key, double depth_m, ScorePath& path) const noexcept;
  /// Distance between nodes: at most a quarter of the length.
  [[nodiscard]] double spacing_m() const { return spacing_m_; }

 private:
  struct Bridge {
    double weight = 0, sd = 0;
  };
  int levels_ = 0;
  double spacing_m_ = 1, inverse_spacing_ = 1;
  double root_rho_ = 0;   // between the ends
  double cell_loss_ = 0;  // 2(1 − ρ) of neighbouring nodes
  std::array<Bridge, kMaxScoreLevels> bridges_;
};

/// Returns the key of the process for this seed and insertion.
std::uint64_t scoreKey(std::uint64_t seed, std::uint64_t insertion) noexcept;

/// Returns the unit normal number of (key, index): Box and Muller 1958 on two mixed words.
double normalOf(std::uint64_t key, std::uint64_t index) noexcept;

}  // namespace needlelab

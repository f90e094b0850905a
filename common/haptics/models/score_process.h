/// A unit Ornstein-Uhlenbeck process over depth that is a function of (key, depth) alone: any depth can be
/// asked for first, the way there does not matter, and nothing but the last answer's neighbourhood is kept.
/// On nodes of a dyadic grid over 1 m it is exact: the ends are drawn jointly, each midpoint from its
/// neighbours a and b at distance h by the process's own bridge,
///   mean ρ(a + b)/(1 + ρ²), variance (1 − ρ²)/(1 + ρ²), ρ = e^(−h/length)
/// (the conditional law of a Gaussian Markov process: Rasmussen and Williams 2006, app. B). Between nodes the
/// score is linear and scaled to variance 1, so that it is a unit normal at every depth and continuous.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/haptics/sim_state.h"

namespace needlelab {

/// Made once, const after that; any thread.
class ScoreProcess {
 public:
  /// `length_m` > 0: the distance over which the correlation falls to 1/e.
  explicit ScoreProcess(double length_m);
  /// The score at a depth (held to [0, 1 m]). `path` must be of the same key, or have cell −1. Real-time
  /// safe: at most 18 normal draws, 2 on average where the tip comes to the next cell, none within a cell.
  double at(std::uint64_t key, double depth_m, ScorePath& path) const noexcept;
  /// Distance of nodes: a quarter of the length or less.
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

/// What a process of this seed and insertion is keyed by.
std::uint64_t scoreKey(std::uint64_t seed, std::uint64_t insertion) noexcept;

/// The unit normal number that belongs to (key, index): Box and Muller 1958 on two mixed words.
double normalOf(std::uint64_t key, std::uint64_t index) noexcept;

}  // namespace needlelab

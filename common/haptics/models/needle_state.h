/// What FEM remembers from tick to tick: plain data, part of SimState.
#pragma once

#include <array>
#include <cstdint>

#include "common/haptics/models/needle_compliance.h"

namespace needlelab {

/// Whether a station of the shaft, or the tip, moves with the tissue.
enum class Hold : std::uint8_t { kSticks, kSlipsIn, kSlipsOut };

/// Value-initialised = the needle is outside and nothing was cut. Lengths along u from the entry, less what a
/// turn or a rupture shifted. Forces act on the tissue, into it positive.
struct NeedleState {
  double x_m = 0;          ///< tip at the last tick
  double cut_m = 0;        ///< the cut's end in the undeformed tissue: the deepest that the tip was
  double gap_m = 0;        ///< from the tip to the cut's end, ≥ 0; 0 while the tip presses
  double tip_N = 0;        ///< [0, cutting force]
  double tip_most_N = 0;   ///< the cutting force at the last tick
  double tip_moved_m = 0;  ///< w at the tip
  Hold tip_hold = Hold::kSticks;
  std::uint32_t unsettled = 0;  ///< ticks whose contact was not settled within the bound
  std::uint32_t solves = 0;     ///< systems solved at the last tick
  std::uint32_t stations = 0;   ///< the first so many entries below have a meaning; 0 before the first tick
  std::array<double, kMaxNeedleStations> shaft_N{};
  std::array<double, kMaxNeedleStations> moved_m{};  ///< w
  std::array<Hold, kMaxNeedleStations> hold{};
};

}  // namespace needlelab

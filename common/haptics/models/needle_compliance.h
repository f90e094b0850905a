/// What a finite-element mesh of the tissue is to the needle: how far each piece of the path gives way along
/// u under an axial force on each other piece. Made by common/fem, shared and never changed after that.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/haptics/limits.h"

namespace needlelab {

/// The path is cut into stations of equal length; station i is the piece of the surface r = radius_m between
/// the depths i·spacing_m and (i + 1)·spacing_m. Depths run along the surface normal, from the skin.
struct NeedleCompliance {
  double spacing_m = 0;              ///< length of a station
  double radius_m = 0;               ///< r₀, of the surface that the needle's load is spread over
  std::vector<double> depth_m;       ///< middle of each station, 1-kMaxNeedleStations of them
  std::vector<double> give_m_per_N;  ///< C, row-major: mean displacement of i per axial force spread over j.
                                     ///< Symmetric, positive definite

  // where it comes from
  std::int32_t nodes = 0, elements = 0;  ///< of the mesh, which is a quarter of the tissue by symmetry
  double assemble_s = 0, factor_s = 0, solve_s = 0;  ///< wall time; solve: all stations
  double one_solve_s = 0;                            ///< one right-hand side
  /// With the needle in to its full depth, all friction and the cutting force on it: share of the elements
  /// whose largest principal strain is above 10 %, where linear elasticity does not hold; and share of the
  /// volume within 5·radius_m of the path, which does not depend on how the mesh is graded.
  double strained_share = 0, strained_near_share = 0;
  std::string source;  ///< in words: mesh, elements, boundary

  [[nodiscard]] std::size_t stations() const { return depth_m.size(); }
  [[nodiscard]] double give(std::size_t i, std::size_t j) const { return give_m_per_N[i * stations() + j]; }
};

}  // namespace needlelab

/// Laws from the literature that the engine does not have: formulas of depth, speed and diameter, only fitted
/// to curves. Each has its own numbers.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/sim/benchmark/training.h"

namespace needlelab {

struct Formula {
  std::string name;     ///< as for models, in tables and JSON
  std::string variant;  ///< its parts, e.g. "4 ruptures"
  std::vector<FitParameter> parameters;
  /// The force at each depth of such an insertion, in N. Depths in any order.
  std::function<std::vector<double>(const std::vector<double>& values, const InsertionKind& kind,
                                    const std::vector<double>& depth_m)>
      forces;
};

/// RATE_DEPENDENT_FRACTURE, after Mahvash and Dupont (ICRA 2009, doi 10.1109/ROBOT.2009.5152617) and Khadem
/// et al. (RA-L 2016, doi 10.1109/LRA.2016.2528301). Before each rupture a Kelvin element (a spring k
/// parallel to a Maxwell element of βk and relaxation time τ) is stretched at the insertion's speed v from
/// its top on: F = k (z + β L (1 − e^(−z/L))), L = vτ. It ruptures when the energy stored in both springs
/// reaches the work of fracture, so a faster needle ruptures earlier. After that, the tip cuts with c
/// (v/v₀)ⁿ, and the shaft rubs with f per inserted length. All forces scale with the diameter as (d/d₀)ᵐ.
/// Simpler than the sources: linear springs; stored energy instead of the J integral. β, τ and f are shared,
/// n if several speeds were fitted on (else 0), m if several diameters were (else 1); per rupture: place,
/// stretch, force, c.
Formula rateDependentFracture(const TrainingSet& training, std::size_t max_numbers);

/// GORDON_EXPONENTIAL, after Gordon, Kim, Barnett and Moore (MSEC2015-9352), the best of five in Traczynski
/// et al. (2024, doi 10.1016/j.jmbbm.2023.106247): an exponential rise to each puncture and an exponential
/// decay after it. Only the abstracts were available: the pieces are theirs, the formula is ours. Independent
/// of speed and diameter. The curvature of the rise and the length of the decay are shared; per rupture: top,
/// place, force, and force after it.
Formula gordonExponential(const TrainingSet& training, std::size_t max_numbers);

}  // namespace needlelab

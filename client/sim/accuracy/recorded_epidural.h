/// Axial force on an epidural needle over depth: polynomials per layer, restated, and the table that the
/// sample profile db/samples/epidural-porcine.json holds.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Force in N = c0 + c1 x + c2 x² + c3 x³, x in mm from the layer's start. Fitted by the source to porcine
/// insertions; repository nitsanti/Epidural-Simulator-Code (code of arXiv 2301.11036), crediting Brazil et
/// al.
struct ForcePolynomial {
  std::string_view tissue;
  double thickness_mm = 0;
  std::array<double, 4> c{};
};
const std::array<ForcePolynomial, 9>& epiduralPolynomials();

/// At a depth below the skin, in N. A depth on a boundary belongs to the layer below.
double epiduralForce_N(double depth_m);

/// Rows so that a line between them is off by at most `error_N`; where the force jumps, two rows 1 µm apart.
/// Forces are rounded to 1e-4 N, depths to 1 µm.
std::vector<PrecomputedSpec::Row> epiduralTable(double error_N);
inline constexpr double kEpiduralTableError_N = 0.01;  ///< of the sample

}  // namespace needlelab

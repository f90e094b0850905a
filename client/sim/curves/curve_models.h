/// Scenes that represent the force-depth curve of one insertion, per axial model: the numbers to fit and the
/// resulting scene.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "client/sim/curves/curve_fit.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A scene, and the recorded depth of its surface.
struct CurveScene {
  SceneSpec spec;
  double surface_m = 0;
};

struct CurveModel {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;  ///< the scene's parts, e.g. "32 layers"
  std::vector<FitParameter> parameters;
  std::function<CurveScene(const std::vector<double>&)> scene;
  /// Numbers derived from the data before the search: the tops of layers. They count like fitted ones.
  std::size_t chosen = 0;
  [[nodiscard]] std::size_t numbers() const { return parameters.size() + chosen; }
};

/// A depth where the force drops suddenly: a rupture.
struct Rupture {
  double depth_m = 0;   ///< of the maximum force before it
  double peak_N = 0;    ///< that force
  double valley_N = 0;  ///< the minimum force after it, before it rises again
  double valley_m = 0;  ///< where that is
};
/// Finds drops by more than `min_drop_N`, ordered by depth.
std::vector<Rupture> findRuptures(const std::vector<CurveBin>& bins, double min_drop_N);

/// A part of a curve between ruptures: where the force starts to rise, where it drops, the maximum force, and
/// the forces before and after.
struct CurvePiece {
  double top_m = 0, rupture_m = 0, peak_N = 0, before_N = 0, after_N = 0;
};
/// Pieces start at the contact and at the end of each rupture but the last; 1 to `most` pieces (`most` is at
/// least 1).
std::vector<CurvePiece> curvePieces(const std::vector<CurveBin>& bins, std::size_t most);

inline constexpr std::size_t kAnyNumbers = 1000;  ///< more than any model here has
inline constexpr std::size_t kMinNumbers = 7;     ///< of the largest model with one rupture

/// All models that can follow an insertion's force over depth. They only see `fit_on` (bins ordered by depth,
/// not empty); layers and tables end at its last bin. Excludes FEM, which is a reference for compliance only,
/// never for cutting. Stiffnesses are at most what the Desktop renders (1000 N/m). Models have at most
/// `max_numbers` to fit (at least kMinNumbers), with fewer layers, ruptures (the smallest drops are
/// omitted) or rows if necessary.
std::vector<CurveModel> curveModels(const std::vector<CurveBin>& fit_on,
                                    std::size_t max_numbers = kAnyNumbers);

/// Layers with one cutting force each, thinnest where the force changes most: for walls and DIRECT. Two
/// numbers per layer except the first, whose top is the surface.
CurveModel layeredModel(AxialModel model, const std::vector<CurveBin>& fit_on,
                        std::size_t max_numbers = kAnyNumbers);
/// The enhanced tracking wall with one membrane per rupture and a cutting force after each: five numbers per
/// rupture.
CurveModel membraneModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers = kAnyNumbers);
/// DIRECT without end, or VOIGT: a line from the contact on. Two or three numbers.
CurveModel lineModel(AxialModel model, const std::vector<CurveBin>& fit_on);
/// GOD_OBJECT: one proxy top per rupture; two numbers per rupture and a common slope.
CurveModel godObjectModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers = kAnyNumbers);
/// FIRST_ORDER: one layer per rupture, five numbers each.
CurveModel firstOrderModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers = kAnyNumbers);
/// OKAMURA or DAHL: one layer per rupture, five numbers each; common kinetic and viscous friction, which
/// cannot be separated at a single speed.
CurveModel okamuraModel(AxialModel model, const std::vector<CurveBin>& fit_on,
                        std::size_t max_numbers = kAnyNumbers);
/// PRECOMPUTED: one row per millimetre, or fewer rows at equal steps.
CurveModel tableModel(const std::vector<CurveBin>& fit_on, std::size_t max_numbers = kAnyNumbers);

}  // namespace needlelab

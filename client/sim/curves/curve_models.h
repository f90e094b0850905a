/// Scenes that represent the force-depth curve of one insertion, per axial model: the numbers to fit, and the
/// resulting scene.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "client/sim/curves/curve_fit.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A scene, and the recorded depth at which its surface lies.
struct CurveScene {
  SceneSpec spec;
  double surface_m = 0;
};

struct CurveModel {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;  ///< the parts of the scene, e.g. "32 layers"
  std::vector<FitParameter> parameters;
  std::function<CurveScene(const std::vector<double>&)> scene;
  /// Numbers that the data chose before the search: the tops of layers. They count as fitted ones do.
  std::size_t chosen = 0;
  [[nodiscard]] std::size_t numbers() const { return parameters.size() + chosen; }
};

/// A depth where the force falls suddenly: a rupture.
struct Rupture {
  double depth_m = 0;   ///< of the greatest force before
  double peak_N = 0;    ///< that force
  double valley_N = 0;  ///< the least force after, before it rises again
  double valley_m = 0;  ///< where that is
};
/// Falls by more than `least_drop_N`, in order of depth.
std::vector<Rupture> findRuptures(const std::vector<CurveBin>& bins, double least_drop_N);

/// A part of a curve between ruptures: where the force begins to rise, where it falls, the greatest force,
/// and the forces before and behind.
struct CurvePiece {
  double top_m = 0, rupture_m = 0, peak_N = 0, before_N = 0, after_N = 0;
};
/// The contact, then the end of each rupture but the last; at least one piece, at most `most` (at least 1).
std::vector<CurvePiece> curvePieces(const std::vector<CurveBin>& bins, std::size_t most);

inline constexpr std::size_t kAnyNumbers = 1000;  ///< more than any model here has
inline constexpr std::size_t kLeastNumbers = 7;   ///< of the largest model with one rupture

/// Every model that can follow an insertion's force over depth. They see `fit_on` only (bins in order of
/// depth, not empty); its last bin is where layers and tables end. FEM is not among them: it is a reference
/// for compliance, never for cutting. Stiffnesses are at most what the Desktop renders (1000 N/m). None has
/// more than `most_numbers` to fit (at least kLeastNumbers): fewer layers, ruptures (the smallest falls are
/// left out) or rows then.
std::vector<CurveModel> curveModels(const std::vector<CurveBin>& fit_on,
                                    std::size_t most_numbers = kAnyNumbers);

/// Layers of one cutting force each, thinnest where the force changes most: walls and DIRECT. Two numbers a
/// layer but the first, whose top is the surface.
CurveModel layeredModel(AxialModel model, const std::vector<CurveBin>& fit_on,
                        std::size_t most_numbers = kAnyNumbers);
/// The enhanced tracking wall with one membrane per rupture and a cutting force behind each: five numbers a
/// rupture.
CurveModel membraneModel(const std::vector<CurveBin>& fit_on, std::size_t most_numbers = kAnyNumbers);
/// DIRECT without end, or VOIGT: a line from the contact on. Two or three numbers.
CurveModel lineModel(AxialModel model, const std::vector<CurveBin>& fit_on);
/// GOD_OBJECT: one proxy top per rupture; two numbers a rupture, and one slope.
CurveModel godObjectModel(const std::vector<CurveBin>& fit_on, std::size_t most_numbers = kAnyNumbers);
/// FIRST_ORDER: one layer per rupture, five numbers each.
CurveModel firstOrderModel(const std::vector<CurveBin>& fit_on, std::size_t most_numbers = kAnyNumbers);
/// OKAMURA or DAHL: one layer per rupture, five numbers each; kinetic and viscous friction of all of them. At
/// one speed these two act as one.
CurveModel okamuraModel(AxialModel model, const std::vector<CurveBin>& fit_on,
                        std::size_t most_numbers = kAnyNumbers);
/// PRECOMPUTED: a row per millimetre, or fewer rows at equal steps.
CurveModel tableModel(const std::vector<CurveBin>& fit_on, std::size_t most_numbers = kAnyNumbers);

}  // namespace needlelab

/// Scenes that represent the force-depth curve of one insertion, per axial model: the numbers to fit, and the
/// resulting scene.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/sim/accuracy/recorded_fit.h"
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

/// Every model that can follow an insertion's force over depth. They see `fit_on` only (bins in order of
/// depth, not empty); its last bin is where layers and tables end. FEM is not among them: it is a reference
/// for compliance, never for cutting. Stiffnesses are at most what the Desktop renders (1000 N/m).
std::vector<CurveModel> curveModels(const std::vector<CurveBin>& fit_on);

/// Layers of one cutting force each, thinnest where the force changes most: walls and DIRECT.
CurveModel layeredModel(AxialModel model, const std::vector<CurveBin>& fit_on);
/// The enhanced tracking wall with one membrane per rupture and a cutting force behind each.
CurveModel membraneModel(const std::vector<CurveBin>& fit_on);
/// DIRECT without end, or VOIGT: a line from the contact on.
CurveModel lineModel(AxialModel model, const std::vector<CurveBin>& fit_on);
/// GOD_OBJECT: one proxy top per rupture.
CurveModel godObjectModel(const std::vector<CurveBin>& fit_on);
/// FIRST_ORDER: one layer per rupture.
CurveModel firstOrderModel(const std::vector<CurveBin>& fit_on);
/// PRECOMPUTED: a row per millimetre.
CurveModel tableModel(const std::vector<CurveBin>& fit_on);

}  // namespace needlelab

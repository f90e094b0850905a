/// The models' forces as formulas, for a needle that goes straight in at a constant speed, turns at once and
/// comes straight out. Written from common/haptics/FORCE_MODEL.md, without the engine's code.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// In from `from_m` above the skin to `deepest_m`, and out again to there, at one speed.
struct TurnGesture {
  double from_m = 0.001, deepest_m = 0, speed_mps = 0;
  [[nodiscard]] double depth_m(double t_s) const;
  [[nodiscard]] double turn_s() const { return (from_m + deepest_m) / speed_mps; }
  [[nodiscard]] double seconds() const { return 2 * turn_s(); }
};

/// A model with the scene in which its answer is a formula.
struct ClosedForm {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;
  SceneSpec scene;
  /// Force along the trajectory at a depth below the skin (above 0), in N; negative pushes the needle out.
  /// `out`: on the way out.
  std::function<double(const TurnGesture& gesture, double depth_m, bool out)> force_N;
  std::string leaves_out;  ///< of the law, because the gesture does not ask for it; may be empty
};

/// All models but STATISTICAL, which has a distribution only, and FEM, whose answer is no formula. Three
/// layers of 10 mm with rising forces; gestures must turn between 24.5 and 27.5 mm.
const std::vector<ClosedForm>& closedForms();

/// The needle at a depth of the closed forms' scenes.
TipSample straightTip(double depth_m);

}  // namespace needlelab

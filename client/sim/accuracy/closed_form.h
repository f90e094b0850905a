/// The models' forces as formulas, for a needle that goes straight in at constant speed, reverses at once and
/// comes straight out. Written from common/haptics/FORCE_MODEL.md, independent of the engine's code.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// In from `from_m` above the skin to `deepest_m` and back, at constant speed.
struct TurnGesture {
  double from_m = 0.001, deepest_m = 0, speed_mps = 0;
  [[nodiscard]] double depth_m(double t_s) const;
  [[nodiscard]] double turn_s() const { return (from_m + deepest_m) / speed_mps; }
  [[nodiscard]] double seconds() const { return 2 * turn_s(); }
};

/// A model with a scene for which its answer is a formula.
struct ClosedForm {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;
  SceneSpec scene;
  /// Force along the trajectory at a depth below the skin (above 0), in N; negative pushes the needle out.
  /// `out`: on the way out.
  std::function<double(const TurnGesture& gesture, double depth_m, bool out)> force_N;
  std::string leaves_out;  ///< parts of the law that the gesture does not test; may be empty
};

/// All models except STATISTICAL, which only has a distribution, and FEM, which has no closed form. Three
/// layers of 10 mm with rising forces; gestures must turn between 24.5 and 27.5 mm.
const std::vector<ClosedForm>& closedForms();

/// The needle at a depth in these scenes.
TipSample straightTip(double depth_m);

}  // namespace needlelab

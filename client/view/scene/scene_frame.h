/// Content of a picture of the 3-D scene (scene_renderer.h).
#pragma once

#include <optional>
#include <vector>

#include "client/view/model/camera.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/palette.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

/// A path of the tip, drawn as a line.
struct TipTrail {
  std::vector<Vec3> points_W_m;
  Rgb colour = kSkyBlue;
};

/// The content to draw. Plain data; a frame that looks the same (within a few hundredths of a mm) is not
/// redrawn.
struct SceneFrame {
  Moment
      moment;  ///< value-initialised (tick 0, outside at the origin): no needle when `show_needle` is false
  bool show_needle = true;
  AidSet aids = usualAidSet();
  OrbitCamera camera;
  std::optional<Moment> second;    ///< another gesture as an overlay: a needle in kSecondGesture
  std::vector<TipTrail> trails;    ///< lines over the picture (sceneWidget only)
  std::optional<PlanView> plan_W;  ///< the exercise's plan, with the aid PLANNED_LINE; a body is cut along it
  bool cut_open = true;            ///< with the aid TISSUES: removes the half facing the eye
  bool show_hand = true;           ///< at the syringe over a body, for scale
  double arrow_extents_per_N = 0.22;  ///< length of force arrows, in scene extents
};

}  // namespace needlelab

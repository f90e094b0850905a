/// The ultrasound slice as a widget with its own refresh rate.
#pragma once

#include <memory>

#include <imgui/imgui.h>

#include "client/view/gl_objects.h"
#include "client/view/model/ultrasound/ultrasound_slice.h"

namespace needlelab {

/// Redraws the slice at most `pictures_per_s` times per second of ImGui's time, and shows it with a depth
/// scale and its cost ("1.8 ms, 15/s"). Call only while its aid is on, to save the computation. Thread: the
/// surface's.
class UltrasoundView {
 public:
  explicit UltrasoundView(double pictures_per_s = 15) : pictures_per_s_(pictures_per_s) {}
  /// `size_px`: 0 is the rest of the window. `hazard_names`: labels hazards with their names and distances
  /// from the plane (the aid ANATOMY).
  void show(const char* id, const SceneView& scene, const Moment& moment, ImVec2 size_px,
            bool hazard_names = false);
  [[nodiscard]] double lastCost_s() const { return cost_s_; }

 private:
  double pictures_per_s_;
  double next_s_ = 0, cost_s_ = 0, mean_cost_s_ = 0;
  bool has_plane_ = false;
  SlicePlane plane_;
  SliceSettings settings_;
  GreyImage image_;
  Texture texture_;
};

}  // namespace needlelab

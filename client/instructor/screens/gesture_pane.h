/// The 3-D scene with its cameras and the stack of plots. The live, replay and comparison screens share them.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/view/model/gesture_plots.h"
#include "client/view/plots.h"
#include "client/view/scene/scene_renderer.h"

namespace needlelab {

/// The camera's viewpoint.
enum class Look : std::uint8_t { kTrainee, kAbove, kSide, kFree };

/// A 3-D scene with its own camera. Thread: the surface's.
class ScenePane {
 public:
  /// Needs a surface. Errors: as SceneRenderer::make.
  static Result<ScenePane> make();

  void look(Look look);
  [[nodiscard]] Look looking() const { return look_; }
  /// Draws camera buttons and the picture; `size_px`: both together. `plan_W`: the exercise's planned line.
  /// `aids`: the visible parts. `second`: a second needle.
  void show(const char* id, const std::shared_ptr<const SceneView>& scene, const Moment& moment,
            const std::optional<PlanView>& plan_W, const AidSet& aids, ImVec2 size_px,
            const std::optional<Moment>& second = {}, std::vector<TipTrail> trails = {});

 private:
  explicit ScenePane(std::unique_ptr<SceneRenderer> renderer) : renderer_(std::move(renderer)) {}
  void showLooks();
  void aim();
  std::unique_ptr<SceneRenderer> renderer_;
  std::shared_ptr<const SceneView> scene_;
  SceneFrame frame_;
  Look look_ = Look::kTrainee;
};

/// The plots in the stack.
enum class PlotSet : std::uint8_t {
  kForces,      ///< forces by effect, depth with its layers, speed
  kMotion,      ///< speed, distance from the own line and tilt against it, depth
  kWallAndTip,  ///< wall and tip per axis, as in the paper's Figs. 8 and 9, and the force
};
/// Shows buttons for the plot set; changes `set`.
void choosePlots(PlotSet& set);
/// Plots [from_s, to_s] of a trace, with the limits of `requirements`. `cursor_s`: where to draw a line with
/// the values.
PlotResult gesturePlots(const char* id, PlotSet set, const GestureTrace& trace, const SceneView* scene,
                        double from_s, double to_s, std::optional<double> cursor_s, ImVec2 size_px,
                        std::span<const PlotRequirement> requirements);

/// Returns the tip's path over the last `seconds` before `until_s`, for the scene.
TipTrail trailOf(const GestureTrace& trace, double until_s, double seconds, Rgb colour);

}  // namespace needlelab

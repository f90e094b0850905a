/// The last insertion of a lesson, shown again after it: where the needle was, step by step.
#pragma once

#include <imgui/imgui.h>

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/station/run/lesson/local_score.h"
#include "client/view/model/gesture_trace.h"
#include "client/view/model/scene_view.h"
#include "client/view/scene/scene_renderer.h"

namespace needlelab {

/// Places in W; times in s of the lesson.
struct InsertionReplay {
  static constexpr double kStep_s = 0.25;

  double from_s = 0, to_s = 0;
  double at_s = 0;                ///< the moment that is shown
  std::vector<Vec3> path_W_m;     ///< of the tip, 100 points a second; on a bone, not where the hand is
  std::vector<Vec3> bone_W_m;     ///< the tip, each time that it met bone
  std::vector<Vec3> opening_W_m;  ///< of the needle's opening during the last injection; empty: none
  std::vector<int> met;           ///< the scene's layers that the tip was in, in order

  /// Moves the shown moment by steps; stays within the insertion.
  void step(int steps);
};

/// The insertion of the last injection in tissue, at the injection's begin; without one the last insertion,
/// at its furthest point: the moment of the miss (missOf). None if `trace` has no insertion. `rate_hz`: of
/// the injections' ticks. Pure.
std::optional<InsertionReplay> insertionReplay(const GestureTrace& trace, const SceneView& scene,
                                               std::span<const TickSpan> injections, double rate_hz);

/// "Last insertion, 1.25 s of 4.10 s: 1.52 N, in deltoid muscle". Pure.
std::string replayText(const InsertionReplay& replay, const Moment& now, const SceneView& scene);

/// The scene's initial view, nearer: the insertion's way takes a third of the picture's height. Pure.
OrbitCamera viewOfInsertion(const SceneView& scene, const InsertionReplay& replay);

/// Draws the limb cut open along the needle at `now`, with the tip's path, the opening's during the
/// injection, and a mark at each contact with bone. The mouse turns `frame`'s camera. Thread: the surface's.
void insertionPicture(const InsertionReplay& replay, const Moment& now, SceneRenderer& renderer,
                      SceneFrame& frame, ImVec2 size_px);
/// Draws what the picture's marks are. `plan`: the picture has the planned line.
void insertionLegend(const InsertionReplay& replay, bool plan);

}  // namespace needlelab

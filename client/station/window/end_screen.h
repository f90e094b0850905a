/// The window after a lesson: how it went, why, and what comes next.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/station/window/lesson_board.h"
#include "client/station/window/verdict.h"
#include "client/view/model/scene_view.h"

namespace needlelab {

/// Thread: the window's.
class EndScreen {
 public:
  /// One frame; `changed`: `state` is newer than at the last call. `scene`: of the lesson; may be null.
  void show(const BoardState& state, bool changed, const SceneView* scene, LessonBoard& board);

 private:
  void take(const LessonOutcome& outcome);
  void showVerdict();
  void showPlots(const LessonOutcome& outcome, const SceneView* scene);
  void showNext(const BoardState& state, LessonBoard& board);

  std::shared_ptr<const LessonOutcome> shown_;
  std::string session_;     // of what is shown
  double keys_from_s_ = 0;  // a key that was meant for the lesson begins nothing
  LessonVerdict verdict_;
  std::vector<double> time_s_, lateral_mm_;
};

}  // namespace needlelab

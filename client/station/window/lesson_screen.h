/// The window while a lesson runs: the limb, what the needle does, what the instructor says.
#pragma once

#include <imgui/imgui.h>

#include <optional>

#include "client/station/run/lesson_requests.h"
#include "client/station/window/lesson_board.h"
#include "client/station/window/lesson_follow.h"
#include "client/station/window/pointer_steering.h"
#include "client/view/scene_renderer.h"
#include "client/view/ultrasound_view.h"

namespace needlelab {

/// What of a lesson stays from frame to frame. Thread: the window's.
class LessonScreen {
 public:
  explicit LessonScreen(SceneRenderer& renderer) : renderer_(renderer) {}
  /// A new lesson.
  void begin(const LessonFollow& lesson);
  /// One frame. `requests`: stop and acknowledge.
  void show(const BoardState& state, const LessonFollow& lesson, LessonRequests& requests);
  /// What the ultrasound picture cost last, in s; for measurements.
  [[nodiscard]] double ultrasoundCost_s() const { return ultrasound_.lastCost_s(); }

 private:
  void showScene(const BoardState& state, const LessonFollow& lesson, ImVec2 size_px);
  void chooseView(const LessonFollow& lesson);
  void steer(const LessonFollow& lesson, bool hovered);
  void askForEnd(LessonRequests& requests);

  SceneRenderer& renderer_;
  UltrasoundView ultrasound_;
  SceneFrame frame_;
  std::optional<PointerSteering> steering_;
  bool held_across_ = false, held_tilt_ = false;
  bool asks_for_end_ = false;
};

/// The side panel of a lesson: figures, ladder, plots, each only with its aid.
void lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px);
/// Fault or hold over the picture; its button acknowledges.
void lessonOverlay(const LessonStanding& standing, LessonRequests& requests, ImVec2 corner_px,
                   ImVec2 size_px);
/// What instructors said, newest last, over the picture's lower left corner.
void lessonMessages(const BoardState& state, ImVec2 corner_px, ImVec2 size_px);

}  // namespace needlelab

/// The window while a lesson runs: limb and needle, side panel, overlays, the instructor's messages.
#pragma once

#include <imgui/imgui.h>

#include <cstdint>
#include <optional>
#include <string>

#include "client/station/run/lesson_observer.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/window/lesson_board.h"
#include "client/station/window/lesson_follow.h"
#include "client/station/window/pointer_steering.h"
#include "client/view/scene_renderer.h"
#include "client/view/ultrasound_view.h"

namespace needlelab {

struct Overlay {
  enum class Kind : std::uint8_t { kNone, kHold, kFault };
  Kind kind = Kind::kNone;
  std::string title;             ///< "The force was taken away"
  std::string what;              ///< why
  std::string todo;              ///< what to do now
  bool can_acknowledge = false;  ///< Enter, or the button, counts now
};

/// Pure.
Overlay overlayOf(const LessonStatus& status);

/// State of a lesson's screen from frame to frame. Thread: the window's.
class LessonScreen {
 public:
  explicit LessonScreen(SceneRenderer& renderer) : renderer_(renderer) {}
  /// A new lesson.
  void begin(const LessonFollow& lesson);
  /// One frame. `requests`: stop and acknowledge.
  void show(const BoardState& state, const LessonFollow& lesson, LessonRequests& requests);
  /// Time for the last ultrasound picture, in s; for measurements.
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

/// Fault or hold over the picture; its button acknowledges.
void lessonOverlay(const LessonStatus& status, LessonRequests& requests, ImVec2 corner_px, ImVec2 size_px);
/// Instructors' messages, newest last, over the picture's lower left corner.
void lessonMessages(const BoardState& state, ImVec2 corner_px, ImVec2 size_px);

}  // namespace needlelab

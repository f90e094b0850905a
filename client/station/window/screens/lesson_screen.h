/// The window during a lesson: limb and needle, side panel, overlays, the instructor's messages.
#pragma once

#include <imgui/imgui.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/station/run/lesson_observer.h"
#include "client/station/run/lesson_requests.h"
#include "client/station/window/lessons/lesson_board.h"
#include "client/station/window/screens/demonstration_player.h"
#include "client/station/window/screens/lesson_follow.h"
#include "client/station/window/screens/lesson_steps.h"
#include "client/station/window/screens/pointer_steering.h"
#include "client/view/action_bar.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/scene_view.h"
#include "client/view/scene/scene_renderer.h"
#include "client/view/ultrasound_view.h"

namespace needlelab {

struct Overlay {
  enum class Kind : std::uint8_t { kNone, kHold, kFault };
  Kind kind = Kind::kNone;
  std::string title;             ///< "The force was taken away"
  std::string what;              ///< the reason
  std::string todo;              ///< the advice
  bool can_acknowledge = false;  ///< Enter and the button work now
};

/// Pure.
Overlay overlayOf(const LessonStatus& status);
/// Trainee and lesson: "tom, attempt 2 (3 left, this one included): Feel the capsule give way." If the server
/// could not check the code, says so instead of the attempt, which does not count yet. `description`: with
/// the exercise's. Pure.
std::string lessonLine(const LessonBeginning& beginning, bool description = true);

/// What to do with the cap on; `landmark` may be empty. Pure.
std::string capText(const std::string& landmark);

/// A lesson's screen and its state between frames. Thread: the window's.
class LessonScreen {
 public:
  explicit LessonScreen(SceneRenderer& renderer) : renderer_(renderer) {}
  /// Begins a new lesson.
  void begin(const LessonFollow& lesson);
  /// Draws one frame. `requests` receives stop and acknowledge. `keys`: whether this screen gets the keys.
  void show(const BoardState& state, const LessonFollow& lesson, bool keys, LessonRequests& requests);
  /// Returns the computing time of the last ultrasound picture in s; for measurements.
  [[nodiscard]] double ultrasoundCost_s() const { return ultrasound_.lastCost_s(); }
  /// Returns whether the last frame showed the question whether to end the lesson.
  [[nodiscard]] bool isOfferingEnd() const { return end_question_.shown(); }
  /// Returns where mouse and keys want the tip, in W; nothing if they do not steer.
  [[nodiscard]] std::optional<Vec3> aim_W_m() const {
    return steering_ ? std::optional(steering_->target().X_WT.p) : std::nullopt;
  }

 private:
  void showHead(const BoardState& state, const LessonFollow& lesson) const;
  void showSteps(const BoardState& state, const LessonFollow& lesson);
  /// Returns whether the mouse is over it.
  bool showScene(const LessonFollow& lesson, const AidSet& aids, ImVec2 size_px);
  void showDemonstration(const LessonFollow& lesson, ImVec2 corner_px, ImVec2 size_px);
  void chooseView(const LessonFollow& lesson);
  void steer(const LessonFollow& lesson, bool hovered);
  void lineUp(const LessonFollow& lesson);
  void offerEnd(const StationLesson& lesson, LessonRequests& requests);

  SceneRenderer& renderer_;
  UltrasoundView ultrasound_;
  SceneFrame frame_;
  std::optional<PointerSteering> steering_;
  std::optional<LessonSteps> steps_;
  Anatomy anatomy_;  // for the steps
  DemonstrationPlayer demonstration_;
  bool held_across_ = false, held_tilt_ = false, shows_details_ = false, keys_ = true;
  Question end_question_{"End this lesson?"};
  AnswerGate fault_gate_;
};

// --- over the picture (lesson_overlays.cpp)

/// Flags of the windows that lie over the picture.
inline constexpr ImGuiWindowFlags kLaidOver =
    ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_AlwaysAutoResize |
    ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoFocusOnAppearing;
/// Whether the newest message came just now. An older one takes only one line, so that it hides nothing.
bool hasFreshMessage(const BoardState& state);
/// Draws alarms as bars over the picture's top, the most urgent in the largest letters, and a frame about the
/// picture.
void lessonAlarms(const std::vector<ActiveAlarm>& alarms, ImVec2 corner_px, ImVec2 size_px);
/// Draws a fault or hold over the picture, with a button to acknowledge. `keys`: whether it gets the keys.
void lessonOverlay(const LessonStatus& status, bool keys, AnswerGate& gate, LessonRequests& requests,
                   ImVec2 corner_px, ImVec2 size_px);
/// Draws instructors' messages, newest last, over the picture's lower left corner.
void lessonMessages(const BoardState& state, ImVec2 corner_px, ImVec2 size_px);

// --- the side panel: figures, the ladder of layers, plots; each appears only with its aid

/// Where the tip stands on the ladder: along the needle, and above the skin negative. None with the cap on:
/// what it presses in is skin.
std::optional<double> ladderMark_m(const Moment& now);

/// Shows names with Aid LAYER, the tip with DEPTH, targets with ANATOMY. Draws nothing without these aids.
void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px);

/// Returns the widths of columns for cells of these widths, placed row by row in `room_px`: all in one row,
/// or in half as many columns until every cell fits. Shares out the remaining width; each column is followed
/// by `gap_px`. A single column takes all the room, even if a cell needs more.
std::vector<float> cellColumns(std::span<const float> needed_px, float gap_px, float room_px);

/// Draws figures, ladder, ultrasound and plots, each only with its aid, and the station's light. Returns
/// whether the light was clicked.
bool lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px);

}  // namespace needlelab

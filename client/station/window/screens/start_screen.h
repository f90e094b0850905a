/// The window before a lesson: trainee, exercise, and the state of the device.
#pragma once

#include <optional>
#include <string>

#include "client/station/run/lesson_requests.h"
#include "client/station/window/lessons/lesson_board.h"
#include "client/station/window/lessons/start_choice.h"

namespace needlelab {

/// Thread: the window's.
class StartScreen {
 public:
  /// Draws one frame and sends a person's requests to `board`. `changed`: `state` is newer than in the last
  /// call. `keys`: whether this screen gets the keys. Returns whether the person wants to quit.
  bool show(const BoardState& state, bool changed, bool keys, bool may_quit, LessonBoard& board);
  /// Returns whether everything that a lesson needs is there.
  [[nodiscard]] bool canBegin() const { return choice_.missing().empty(); }

 private:
  void showTrainees();
  void showTypedName();
  void typeName();
  void showCode(bool writes_name);
  void showExercises();
  /// Returns the button that was pressed.
  std::optional<int> showStation(const BoardState& state, bool may_quit);
  void act(std::optional<int> action, LessonBoard& board);
  void requestStanding(LessonBoard& board);

  StartChoice choice_;
  std::string typed_;      // the name's field: as shown
  bool typing_ = false;    // the name, by keys, without entering the field
  std::string asked_for_;  // the trainee whose standing was requested last, and when
  std::int64_t asked_unix_ns_ = 0, updated_unix_ns_ = 0;
  std::optional<LessonChoice> scrolled_to_;
  float scrolled_px_ = 0;            // where it was then
  std::uint64_t code_question_ = 0;  // for which the code's field is open; 0: none
  bool in_empty_code_ = false;       // the code's field has the keys and is still empty
  bool fresh_ = true;
};

/// Shows "Fetching the exercise …" and a button to cancel.
void showPreparing(const BoardState& state, LessonRequests& requests);
/// Shows why the station cannot continue. Returns whether the person wants to quit.
bool showFailed(const BoardState& state, bool keys, bool may_quit);

}  // namespace needlelab

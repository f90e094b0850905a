/// The window before a lesson: trainee, exercise, and the state of the device.
#pragma once

#include <optional>
#include <string>

#include "client/station/run/lesson_requests.h"
#include "client/station/window/lesson_board.h"
#include "client/station/window/start_choice.h"

namespace needlelab {

/// Thread: the window's.
class StartScreen {
 public:
  /// Draws one frame and sends a person's requests to `board`. `changed`: `state` is newer than in the last
  /// call. `keys`: the keys are for this screen. Returns whether the person wants to quit.
  bool show(const BoardState& state, bool changed, bool keys, bool may_quit, LessonBoard& board);
  /// Returns whether all is there that a lesson needs.
  [[nodiscard]] bool canBegin() const { return choice_.missing().empty(); }

 private:
  void showTrainees();
  void showCode(bool writes_name);
  void showExercises();
  /// Returns the button that was pressed.
  std::optional<int> showStation(const BoardState& state, bool may_quit);
  void act(std::optional<int> action, LessonBoard& board);
  void askForStanding(LessonBoard& board);

  StartChoice choice_;
  std::string typed_;      // the name's field: as shown
  std::string asked_for_;  // the trainee of the last request for a standing, and its time
  std::int64_t asked_unix_ns_ = 0, updated_unix_ns_ = 0;
  std::uint64_t code_question_ = 0;  // that the code's field is open for; 0: none
  bool in_empty_code_ = false;       // nothing is typed yet in the code's field, which has the keys
  bool fresh_ = true;
};

/// Shows "Fetching the exercise …" and a button to cancel.
void showPreparing(const BoardState& state, LessonRequests& requests);
/// Shows why the station cannot continue. Returns whether the person wants to quit.
bool showFailed(const BoardState& state, bool keys, bool may_quit);

}  // namespace needlelab

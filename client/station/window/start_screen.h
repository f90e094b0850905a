/// The window before a lesson: trainee, exercise, and the state of the device.
#pragma once

#include <string>

#include "client/station/run/lesson_requests.h"
#include "client/station/window/lesson_board.h"
#include "client/station/window/start_choice.h"

namespace needlelab {

/// Thread: the window's.
class StartScreen {
 public:
  /// One frame; sends a person's requests to `board`. `changed`: `state` is newer than at the last call.
  void show(const BoardState& state, bool changed, LessonBoard& board);

 private:
  void showTrainees();
  void showExercises();
  void showStation(const BoardState& state, LessonBoard& board);
  void begin(LessonBoard& board);

  StartChoice choice_;
  std::string typed_;  // the name's field
  bool fresh_ = true;
};

/// "Fetching the exercise …", with a way back.
void showPreparing(const BoardState& state, LessonRequests& requests);
/// It cannot go on: why, and that one can quit.
void showFailed(const BoardState& state, LessonBoard& board);

}  // namespace needlelab

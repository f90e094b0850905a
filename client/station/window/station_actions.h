/// What a trainee can do on each screen, as tables (client/view/model/screen_actions.h). Pure.
#pragma once

#include <string>
#include <vector>

#include "client/station/window/lesson_board.h"
#include "client/view/model/screen_actions.h"

namespace needlelab {

enum StationAct : int {
  kActBegin,
  kActLook,
  kActNext,   ///< the exercise that an instructor suggested
  kActAgain,  ///< the same exercise
  kActOther,
  kActSeen,  ///< acknowledges a fault
  kActQuit,
  kActYes,
  kActNo,
};

/// `can_begin`: trainee, exercise and device are there. A full screen has no button of its own to close it.
std::vector<ScreenAction> startActions(bool can_begin, bool may_quit);
/// After a lesson. Enter is the suggested exercise, else the next try, however the lesson went.
std::vector<ScreenAction> endActions(const BoardState& state, bool may_quit);
/// What a key's action does after a lesson. `characters_typed`: since the screen came, though nothing is
/// written there; somebody, who may be the next trainee, holds a badge to the reader, which ends with Enter.
/// Then it begins no lesson, which would be the last trainee's, but leads to the Start screen.
int endActionByKey(int action, bool characters_typed);
/// When the station cannot work.
std::vector<ScreenAction> failedActions(bool may_quit);
std::vector<ScreenAction> faultActions();
/// The answers to "End this lesson?"
std::vector<ScreenAction> endLessonActions();
/// The answers to "Quit?"
std::vector<ScreenAction> quitActions();
/// What quitting does now to the lesson and its recording.
std::string quitText(const BoardState& state);

}  // namespace needlelab

/// What a trainee can do on each screen, as tables (client/view/model/screen_actions.h). Pure.
#pragma once

#include <string>
#include <vector>

#include "client/station/window/lessons/lesson_board.h"
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

/// `can_begin`: trainee, exercise and device are ready. A full-screen window has no close button of its own.
std::vector<ScreenAction> startActions(bool can_begin, bool may_quit);
/// After a lesson. Enter begins the suggested exercise, otherwise the next try, even after a failed lesson.
std::vector<ScreenAction> endActions(const BoardState& state, bool may_quit);
/// Returns what a key's action does after a lesson. `characters_typed`: since the screen came, although
/// nothing is typed there: somebody, perhaps the next trainee, held a badge to the reader, which ends with
/// Enter. The key then leads to the Start screen instead of beginning a lesson of the last trainee.
int endActionByKey(int action, bool characters_typed);
/// When the station cannot work.
std::vector<ScreenAction> failedActions(bool may_quit);
std::vector<ScreenAction> faultActions();
/// The answers to "End this lesson?"
std::vector<ScreenAction> endLessonActions();
/// The answers to "Quit?"
std::vector<ScreenAction> quitActions();
/// Returns what quitting does now to the lesson and its recording.
std::string quitText(const BoardState& state);

}  // namespace needlelab

/// What a trainee can do on each screen, as tables (client/view/model/screen_actions.h), and the station's
/// light.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/station/run/lesson_observer.h"
#include "client/station/window/lessons/lesson_board.h"
#include "client/view/model/palette.h"
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
/// If no attempt is left there is no next try.
std::vector<ScreenAction> endActions(const BoardState& state, bool may_quit);
/// Draws the hint for ← and →, which step through the last insertion, and returns the steps that they ask for
/// in this frame: −1, 0 or 1; a held key repeats.
int replaySteps();
/// Returns what a key's action does after a lesson. `characters_typed`: since the screen came, although
/// nothing is typed there: somebody, perhaps the next trainee, held a badge to the reader, which ends with
/// Enter. The key then leads to the Start screen instead of beginning a lesson of the last trainee.
int endActionByKey(int action, bool characters_typed);
/// When the station cannot work.
std::vector<ScreenAction> failedActions(bool may_quit);
std::vector<ScreenAction> faultActions();
/// The answers to "Begin the exam?"
std::vector<ScreenAction> beginExamActions();
/// The answers to "End this lesson?"; `what`: lessonWord.
std::vector<ScreenAction> endLessonActions(const std::string& what = "lesson");
/// "exam", or "lesson".
std::string lessonWord(const StationLesson& lesson);
/// The answers to "Quit?"
std::vector<ScreenAction> quitActions();
/// Returns what quitting does now to the lesson and its recording.
std::string quitText(const BoardState& state);

// --- one light for what a trainee need not read about the station, and the facts behind it, for a technician

/// `kUnknown`: nothing to judge.
struct StationFact {
  Condition condition = Condition::kUnknown;
  std::string words;
};

/// The server in the uplink's words: "server away, 3 chunks wait". Pure.
StationFact serverFact(const std::string& server);
/// During a lesson: loop, recording and server, room, samples missing from the picture, who chose the aids,
/// the needle's tilt limit, notes of the device. `dropped`: number of samples missing from this picture.
/// Pure.
std::vector<StationFact> lessonFacts(const BoardState& state, const LessonBeginning& beginning,
                                     std::uint64_t dropped, double alpha_rad);

/// Returns the worst condition; kGood if there is nothing to judge.
Condition lightOf(std::span<const StationFact> facts);
/// "Station OK", or "Check station".
const char* lightText(Condition light);

/// Draws the light with its key. Returns whether it was clicked.
bool stationLight(Condition light);
/// Draws the facts one below the other.
void showFacts(std::span<const StationFact> facts);

}  // namespace needlelab

/// One light for what a trainee need not read about the station, and the facts behind it, for a technician.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/station/run/lesson_observer.h"
#include "client/station/window/lessons/lesson_board.h"
#include "client/view/model/palette.h"

namespace needlelab {

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
/// "Station OK", or "Station: look".
const char* lightText(Condition light);

/// Draws the light with its key. Returns whether it was clicked.
bool stationLight(Condition light);
/// Draws the facts one below the other.
void showFacts(std::span<const StationFact> facts);

}  // namespace needlelab

#include "client/station/window/screens/station_actions.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <string>

namespace needlelab {
namespace {

using testing::HasSubstr;

BoardState calm() {
  BoardState state;
  state.status.time_s = 10;
  state.status.spool = "recording";
  state.status.server = "server";
  state.status.wakeup.p99_ns = 45'000;
  return state;
}

std::string wordsOf(const std::vector<StationFact>& facts) {
  std::string words;
  for (const StationFact& fact : facts) words += fact.words + "\n";
  return words;
}

TEST(StationLight, isOneWordWhereAllIsWell) {
  LessonBeginning beginning;
  beginning.device_notes = {"the device renders no torque"};
  BoardState state = calm();
  state.aids_by = "ines";
  const auto facts = lessonFacts(state, beginning, 0, 0.4);
  EXPECT_EQ(lightOf(facts), Condition::kGood) << wordsOf(facts);
  EXPECT_STREQ(lightText(lightOf(facts)), "Station OK");
  for (const char* words : {"loop 1000 Hz: 99 % within 45 µs, 0 missed", "recording", "server",
                            "tilt limit α 23°", "the device renders no torque", "ines chose what is shown"})
    EXPECT_THAT(wordsOf(facts), HasSubstr(words));
}

TEST(StationLight, isThatOfTheWorstFact) {
  struct Row {
    Condition light;
    void (*break_it)(BoardState&);
  };
  const Row rows[] = {
      {Condition::kAttention, [](BoardState& s) { s.status.missed_ticks = 20; }},
      {Condition::kTrouble, [](BoardState& s) { s.status.missed_ticks = 200; }},
      {Condition::kTrouble, [](BoardState& s) { s.status.spool = "the disk is full"; }},
      {Condition::kAttention, [](BoardState& s) { s.status.server = "server away, 3 chunks wait"; }},
      {Condition::kAttention, [](BoardState& s) { s.status.server = "server has no room, 3 chunks wait"; }},
      {Condition::kAttention, [](BoardState& s) { s.status.server = "server refuses"; }},
      {Condition::kGood, [](BoardState& s) { s.status.server = "server, 3 chunks behind"; }},
      {Condition::kTrouble, [](BoardState& s) { s.status.room = "room for 20 minutes"; }},
  };
  for (const Row& row : rows) {
    BoardState state = calm();
    row.break_it(state);
    const auto facts = lessonFacts(state, LessonBeginning(), 0, 0);
    EXPECT_EQ(lightOf(facts), row.light) << wordsOf(facts);
    EXPECT_STREQ(lightText(lightOf(facts)), row.light == Condition::kGood ? "Station OK" : "Check station");
  }
  EXPECT_EQ(lightOf(lessonFacts(calm(), LessonBeginning(), 7, 0)), Condition::kAttention)
      << "a gap in the picture";
}

}  // namespace
}  // namespace needlelab

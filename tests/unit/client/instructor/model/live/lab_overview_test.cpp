#include "client/instructor/model/live/lab_overview.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include <cmath>

#include "common/haptics/gate/force_gate.h"
#include "tests/unit/client/instructor/status_alarms.h"

namespace needlelab {
namespace {

const std::string kSession(16, 's');

pb::StationStatus practising(const std::string& station) {
  pb::StationStatus status;
  status.set_station(station);
  status.set_online(true);
  status.set_session_id(kSession);
  status.set_trainee("tina");
  status.set_exercise_id("knee-recess");
  status.set_phase(1);
  status.set_layer(2);
  status.set_insertion_m(0.02);
  status.set_force_n(2);
  return status;
}

std::vector<std::string> names(const std::vector<const StationTile*>& tiles) {
  std::vector<std::string> list;
  for (const StationTile* tile : tiles) list.push_back(tile->station);
  return list;
}

/// Each state of a station and what it needs.
TEST(LabOverview, whatAStationNeeds) {
  struct Row {
    const char* name;
    Need need;
    std::function<void(LabOverview&)> happens;
  };
  const auto report = [](LabOverview& lab, double at_s, auto change) {
    auto status = practising("one");
    change(status);
    lab.onStatus(status, at_s);
  };
  const std::vector<Row> rows = {
      {"a lesson", Need::kPractising, [&](auto& lab) { report(lab, 0, [](auto&) {}); }},
      {"idle", Need::kWaiting, [&](auto& lab) { report(lab, 0, [](auto& s) { s.clear_session_id(); }); }},
      {"a lesson that ended", Need::kDone,
       [&](auto& lab) {
         report(lab, 0, [](auto&) {});
         report(lab, 1, [](auto& s) { s.clear_session_id(); });
       }},
      {"a lesson that ended long ago", Need::kWaiting,
       [&](auto& lab) {
         report(lab, 0, [](auto&) {});
         report(lab, 1, [](auto& s) { s.clear_session_id(); });
         lab.tick(1 + kDoneLasts_s + 1);
       }},
      {"a fault", Need::kFault,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { s.set_fault(static_cast<std::uint32_t>(Fault::kTipTooFast)); });
       }},
      {"an alarm", Need::kAlarm,
       [&](auto& lab) { report(lab, 0, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); }); }},
      {"an alarm that is over", Need::kAlarm,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); });
         report(lab, 600, [](auto& s) { addAlarm(s, "hazard", 1, false, "nerve"); });
       }},
      {"an alarm of a lesson that has ended", Need::kAlarm,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { addAlarm(s, "force", 1, true, "9.0 N, allowed 8 N"); });
         report(lab, 1, [](auto& s) { s.clear_session_id(); });
       }},
      {"an alarm that was acknowledged", Need::kPractising,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); });
         lab.acknowledge("one");
         report(lab, 1, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); });
       }},
      {"the same alarm again", Need::kAlarm,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); });
         lab.acknowledge("one");
         report(lab, 1, [](auto& s) { addAlarm(s, "hazard", 2, false, "nerve"); });
       }},
      {"an alarm that this program does not know", Need::kPractising,
       [&](auto& lab) { report(lab, 0, [](auto& s) { addAlarm(s, "flood", 1, true, "water"); }); }},
      {"a hand", Need::kHand, [&](auto& lab) { report(lab, 0, [](auto& s) { s.set_hand_raised(true); }); }},
      {"the device rests", Need::kTrouble,
       [&](auto& lab) { report(lab, 0, [](auto& s) { s.set_trouble("disk nearly full"); }); }},
      {"a fault goes before an alarm", Need::kFault,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) {
           s.set_fault(2);
           addAlarm(s, "bone", 1, true, "bone contact");
         });
       }},
      {"an alarm that nobody saw, and the next lesson", Need::kAlarm,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); });
         report(lab, 1, [](auto& s) { s.set_session_id("another-session-"); });
       }},
      {"an alarm that nobody saw, and the station switched off", Need::kAlarm,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { addAlarm(s, "hazard", 1, true, "nerve"); });
         report(lab, 1, [](auto& s) { s.set_online(false); });
       }},
      {"gone in mid-lesson", Need::kLost,
       [&](auto& lab) {
         report(lab, 0, [](auto&) {});
         report(lab, 1, [](auto& s) { s.set_online(false); });
       }},
      {"switched off", Need::kOffline,
       [&](auto& lab) {
         report(lab, 0, [](auto& s) { s.clear_session_id(); });
         report(lab, 1, [](auto& s) { s.set_online(false); });
       }},
  };
  for (const Row& row : rows) {
    LabOverview lab;
    row.happens(lab);
    const StationTile* tile = lab.find("one");
    ASSERT_NE(tile, nullptr) << row.name;
    EXPECT_EQ(nameOf(tile->need), nameOf(row.need)) << row.name;
    EXPECT_EQ(lab.counts()[static_cast<std::size_t>(row.need)], 1u) << row.name;
  }
}

TEST(LabOverview, aTileNamesWhoPractisesOrOmitsIt) {
  const std::string exercise = "Knee: suprapatellar recess";
  LabOverview lab;
  const auto words = [&] { return lessonWords(*lab.find("one"), exercise); };
  auto status = practising("one");
  status.set_trainee("tom");
  lab.onStatus(status, 0);
  EXPECT_EQ(words(), "tom · " + exercise);
  auto idle = status;
  idle.clear_session_id();
  idle.clear_trainee();
  lab.onStatus(idle, 1);
  EXPECT_EQ(words(), "tom · " + exercise) << "who is done";
  lab.tick(1 + kDoneLasts_s + 1);
  EXPECT_EQ(words(), "tom · " + exercise) << "until the next lesson";
  // the next lesson, before the server has its session: do not show the previous name
  auto next = practising("one");
  next.set_session_id("another-session-");
  next.clear_trainee();
  lab.onStatus(next, 200);
  EXPECT_EQ(nameOf(lab.find("one")->need), "practising");
  EXPECT_EQ(words(), "name not known yet · " + exercise);
  next.set_trainee("zoe");
  lab.onStatus(next, 201);
  EXPECT_EQ(words(), "zoe · " + exercise);
}

TEST(LabOverview, alarmsOfEarlierLessonsKeepTheirTraineesUntilTheyAreSeen) {
  LabOverview lab;
  auto status = practising("one");
  for (const char* trainee : {"ann", "zoe", "tom"}) {
    status.set_session_id(std::string(13, ' ') + trainee);
    status.set_trainee(trainee);
    addAlarm(status, "hazard", 1, true, "nerve");
    lab.onStatus(status, 1);
  }
  const StationTile& tile = *lab.find("one");
  EXPECT_EQ(tile.why, "HAZARD nerve; 2 more");
  std::string words;
  for (const TileAlarm& alarm : tile.alarms) words += alarm.words + (alarm.now ? "|" : " (over)|");
  EXPECT_EQ(words, "HAZARD nerve|zoe, earlier: HAZARD nerve (over)|ann, earlier: HAZARD nerve (over)|");
  lab.acknowledge("one");
  status.clear_session_id();
  lab.onStatus(status, 2);
  EXPECT_TRUE(tile.alarms.empty());
}

TEST(LabOverview, aLessonThatIsDoneIsAsGoodAsItsVerdict) {
  const std::tuple<std::optional<bool>, const char*, Condition> rows[] = {
      {true, "passed", Condition::kGood},
      {false, "not passed", Condition::kAttention},
      {{}, "no requirements", Condition::kUnknown}};
  for (const auto& [passed, words, condition] : rows) {
    LabOverview lab;
    auto status = practising("one");
    lab.onStatus(status, 0);
    status.clear_session_id();
    lab.onStatus(status, 1);
    EXPECT_EQ(lab.verdictsToRequest(1), std::vector<std::string>{kSession});
    EXPECT_TRUE(lab.verdictsToRequest(1.1).empty()) << "asked a moment ago";
    const StationTile& tile = *lab.find("one");
    pb::SessionInfo info;
    info.mutable_description()->set_session_id(kSession);
    lab.takeVerdict(info);
    EXPECT_EQ(tile.verdict, "no verdict yet");
    EXPECT_EQ(conditionOf(tile), Condition::kUnknown);
    if (passed) info.set_passed(*passed);
    info.set_score_json("[]");
    lab.takeVerdict(info);
    EXPECT_EQ(tile.verdict, words);
    EXPECT_EQ(conditionOf(tile), condition) << words;
    EXPECT_TRUE(lab.verdictsToRequest(9).empty());
  }
}

TEST(LabOverview, aTileOmitsUnknownFiguresAndGivesUnits) {
  StationTile tile;
  EXPECT_EQ(healthWords(tile), "offline");
  tile.online = true;
  EXPECT_EQ(healthWords(tile), "") << "no 0 µs of a station that does not say";
  tile.wakeup_p99_us = 12;
  EXPECT_EQ(healthWords(tile), "loop: 99 % within 12 µs");
  tile.missed_ticks = 1;
  tile.spool_left = 3;
  tile.server = "b";
  EXPECT_EQ(healthWords(tile), "loop: 99 % within 12 µs, 1 tick missed, 3 chunks wait, server b");
  tile.wakeup_p99_us = 0;
  EXPECT_EQ(healthWords(tile), "1 tick missed, 3 chunks wait, server b");
  tile.force_N = 2.34;
  tile.peak_force_N = 4;
  EXPECT_EQ(forceWords(tile), "2.3 N, peak 4.0 N");
  tile.session_id = "a-session";
  tile.phase = 1;
  tile.layer = 1;
  tile.insertion_m = 0.0123;
  EXPECT_THAT(depthWords(tile), testing::EndsWith(", 12.3 mm, tip in layer 2"));
}

TEST(LabOverview, aTileKeepsItsPlaceWhateverItsNeed) {
  LabOverview lab;
  for (const char* name : {"station-10", "station-2", "Station-1", "bench"})
    lab.onStatus(practising(name), 0);
  const std::vector<std::string> places = {"bench", "Station-1", "station-2", "station-10"};
  EXPECT_EQ(names(lab.tiles()), places);
  auto bad = practising("station-10");
  bad.set_fault(4);
  lab.onStatus(bad, 1);
  auto strong = practising("station-2");
  strong.set_force_n(5);
  lab.onStatus(strong, 3);
  EXPECT_EQ(names(lab.tiles()), places);
}

std::vector<std::string> calling(const LabOverview& lab, double now_s) {
  std::vector<std::string> words;
  for (const HelpCall* call : lab.calls().open(now_s))
    words.push_back(call->station + ": " + call->words + (lab.find(call->station)->calls ? "" : " (quiet)"));
  return words;
}

TEST(LabOverview, theMostUrgentCallsFirstThenWhoWaitsLongest) {
  using testing::ElementsAre;
  LabOverview lab;
  auto raised = practising("one"), again = practising("two"), bad = practising("three");
  raised.set_hand_raised(true);
  again.set_hand_raised(true);
  bad.set_fault(4);
  lab.onStatus(again, 1);
  lab.onStatus(raised, 2);
  lab.onStatus(bad, 3);
  const std::string fault = "three: " + lab.find("three")->why;
  EXPECT_THAT(calling(lab, 3), ElementsAre(fault, "two: asks for help", "one: asks for help"));
  lab.acknowledge("two");
  lab.onStatus(again, 4);
  EXPECT_THAT(calling(lab, 4), ElementsAre(fault, "one: asks for help", "two: asks for help (quiet)"));
  again.set_hand_raised(false);
  lab.onStatus(again, 5);
  EXPECT_THAT(calling(lab, 5), ElementsAre(fault, "one: asks for help"));
  ASSERT_EQ(lab.calls().over().size(), 1U);
  EXPECT_EQ(lab.calls().over()[0].station, "two");
  EXPECT_EQ(lab.calls().over()[0].since_s, 1);
  EXPECT_EQ(lab.calls().over()[0].over_s, 5);
  again.set_hand_raised(true);
  lab.onStatus(again, 6);
  EXPECT_TRUE(lab.find("two")->calls) << "a hand raised again is another call";
}

TEST(LabOverview, aCallThatWasPutOffComesBack) {
  LabOverview lab;
  auto raised = practising("one");
  raised.set_hand_raised(true);
  lab.onStatus(raised, 10);
  EXPECT_TRUE(lab.find("one")->calls);
  lab.snooze("one");
  lab.tick(10 + LabOverview::kSnooze_s - 1);
  EXPECT_FALSE(lab.find("one")->calls);
  lab.tick(10 + LabOverview::kSnooze_s);
  EXPECT_TRUE(lab.find("one")->calls);
}

TEST(LabOverview, missedTicksCallWhereTheySpoilALesson) {
  for (const auto& [missed, need] :
       {std::pair(std::uint64_t{99}, Need::kPractising), {101, Need::kTrouble}}) {
    LabOverview lab;
    auto status = practising("one");
    status.set_samples(10'000);
    status.set_missed_ticks(missed);
    lab.onStatus(status, 0);
    EXPECT_EQ(nameOf(lab.find("one")->need), nameOf(need)) << missed;
  }
}

TEST(LabOverview, filtersByTextAndByWhoIsThere) {
  LabOverview lab;
  lab.onStatus(practising("bench-1"), 0);
  auto bad = practising("bench-2");
  bad.set_trouble("no disk");
  bad.set_trainee("Tom");
  lab.onStatus(bad, 0);
  auto away = practising("bench-3");
  away.clear_session_id();
  away.set_online(false);
  lab.onStatus(away, 0);
  EXPECT_EQ(names(lab.tiles({.only_online = true})).size(), 2u);
  EXPECT_EQ(names(lab.tiles({.text = "TOM"})), std::vector<std::string>{"bench-2"});
  EXPECT_EQ(lab.tiles({.text = "KNEE-rec"}).size(), 2u);
  EXPECT_TRUE(lab.tiles({.text = "nobody"}).empty());
}

TEST(LabOverview, thePeakIsThatOfTheLesson) {
  LabOverview lab;
  const auto force = [&](double newtons, char session, double at_s) {
    auto status = practising("one");
    status.set_session_id(std::string(16, session));
    status.set_force_n(newtons);
    lab.onStatus(status, at_s);
    return lab.find("one")->peak_force_N;
  };
  EXPECT_EQ(force(1, 'a', 0), 1);
  EXPECT_EQ(force(3, 'a', 1), 3);
  EXPECT_EQ(force(2, 'a', 2), 3);
  EXPECT_EQ(lab.find("one")->lesson_s, 2);
  EXPECT_EQ(lab.find("one")->forces_N.size(), 3u);
  EXPECT_EQ(force(1, 'b', 3), 1);
  EXPECT_EQ(lab.find("one")->lesson_s, 0);
}

TEST(LabOverview, stationsThatTheServerNoLongerKnowsGoAndOthersComeOffline) {
  LabOverview lab;
  lab.onStatus(practising("old"), 0);
  pb::Stations stations;
  stations.add_stations()->set_name("new");
  auto& revoked = *stations.add_stations();
  revoked.set_name("stolen");
  revoked.set_revoked(true);
  lab.setStations(stations, 1);
  EXPECT_EQ(names(lab.tiles()), std::vector<std::string>{"new"});
  EXPECT_EQ(lab.find("new")->need, Need::kOffline);
}

TEST(LabOverview, aSilentStationIsStale) {
  LabOverview lab;
  lab.onStatus(practising("one"), 0);
  lab.tick(kStale_s - 0.1);
  EXPECT_FALSE(lab.find("one")->stale);
  lab.tick(kStale_s + 0.1);
  EXPECT_TRUE(lab.find("one")->stale);
  lab.onStatus(practising("one"), 5);
  EXPECT_FALSE(lab.find("one")->stale);
  lab.connectionLost();
  EXPECT_TRUE(lab.find("one")->stale);
}

TEST(LabOverview, networkTextIsSanitizedForDisplay) {
  LabOverview lab;
  auto status = practising("one");
  status.set_trainee("a\x1b[31mb");
  status.set_force_n(std::numeric_limits<double>::quiet_NaN());
  status.set_insertion_m(std::numeric_limits<double>::infinity());
  status.set_fault(4'000'000'000u);
  lab.onStatus(status, 0);
  EXPECT_EQ(lab.find("one")->trainee, "a?[31mb");
  EXPECT_EQ(lab.find("one")->force_N, 0);
  EXPECT_EQ(lab.find("one")->insertion_m, 0);
  EXPECT_EQ(lab.find("one")->need, Need::kFault);
}

TEST(LabOverview, eachNeedHasItsOwnWord) {
  std::set<std::string_view> words;
  for (std::size_t i = 0; i < kNeedCount; ++i) words.insert(nameOf(static_cast<Need>(i)));
  EXPECT_EQ(words.size(), kNeedCount);
}

TEST(LabOverview, theReasonGivesItsNumbersAndNames) {
  struct Row {
    const char* why;
    std::vector<std::function<void(pb::StationStatus&)>> lines;  ///< one per second
  };
  const auto force = [](double newtons, double limit_N) {
    return [=](pb::StationStatus& s) {
      s.set_force_n(newtons);
      if (limit_N != 0) s.set_force_limit_n(limit_N);
    };
  };
  const std::vector<Row> rows = {
      {"", {force(2, 5)}},
      {"TOO MUCH FORCE 9.1 N, allowed 6 N",
       {[](auto& s) { addAlarm(s, "force", 1, true, "9.1 N, allowed 6 N"); }}},
      {"HAZARD nerve?", {[](auto& s) { addAlarm(s, "hazard", 1, true, "nerve\n"); }}},
      {"the disk is full?", {[](auto& s) { s.set_trouble("the disk is full\n"); }}},
      {"the needle's tip jumped faster than 5 m/s",
       {[](auto& s) { s.set_fault(static_cast<std::uint32_t>(Fault::kTipTooFast)); }}},
      {"the lesson continues at the station and is stored there",
       {force(1, 6), [](auto& s) { s.set_online(false); }}}};
  for (const Row& row : rows) {
    LabOverview lab;
    double at_s = 0;
    for (const auto& change : row.lines) {
      auto status = practising("one");
      change(status);
      lab.onStatus(status, at_s++);
    }
    EXPECT_EQ(lab.find("one")->why, row.why);
  }
}

TEST(LabOverview, aTileNamesTheServerThatHasTheStation) {
  LabOverview lab;
  auto status = practising("one");
  lab.onStatus(status, 0);
  EXPECT_EQ(lab.find("one")->server, "");
  status.set_server("b\n");
  lab.onStatus(status, 0);
  EXPECT_EQ(lab.find("one")->server, "b?");
}

TEST(LabOverview, aReturningStationIsOnlineAndItsNextLessonFresh) {
  LabOverview lab;
  auto status = practising("one");
  status.set_force_n(9);
  lab.onStatus(status, 0);
  auto away = practising("one");
  away.set_online(false);
  lab.onStatus(away, 1);
  lab.onStatus(away, 2);  // reported again
  EXPECT_EQ(lab.find("one")->need, Need::kLost);
  EXPECT_EQ(lab.find("one")->peak_force_N, 9) << "its last values stay";
  auto idle = practising("one");
  idle.clear_session_id();
  lab.onStatus(idle, 3);
  EXPECT_EQ(lab.find("one")->need, Need::kDone) << "its lesson ended while it was away";
  auto next = practising("one");
  next.set_session_id(std::string(16, 'n'));
  lab.onStatus(next, 4);
  EXPECT_EQ(lab.find("one")->need, Need::kPractising);
  EXPECT_EQ(lab.find("one")->peak_force_N, 2);
}

}  // namespace
}  // namespace needlelab

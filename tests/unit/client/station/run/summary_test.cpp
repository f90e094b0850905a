#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <set>

#include "client/station/run/summary.h"
#include "common/haptics/engine.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

StationSummary example() {
  StationSummary s;
  s.session_id = "019aa0c3-7c1e-7b3a-9d5e-0123456789ab";
  s.rate_hz = 1000;
  s.servo.end = ServoEnd::kTicksDone;
  s.servo.ticks = 1000;
  s.servo.samples = 990;
  s.servo.missed_ticks = 10;
  for (int i = 0; i < 990; ++i) s.servo.wakeup.add(i < 900 ? 20'000 : 50'000);
  s.servo.flag_ticks[5] = 7;
  s.writer.samples = 990;
  s.writer.chunk_bytes = 990 * 8;
  s.writer.chunks = 1;
  s.spool = "/spool";
  s.state = "OPEN";
  return s;
}

TEST(StationSummary, theJsonHasTheDocumentedKeys) {
  StationSummary s = example();
  s.samples_acked = 500;
  s.spool_left = 3;
  s.score_json = R"([{"measure": "elapsed_s", "value": 1, "unit": "s", "words": "Elapsed time 1 s"}])";
  s.score_source = "server";
  const auto json = nlohmann::json::parse(summaryJson(s));
  ASSERT_EQ(json["rows"].size(), 1u);
  EXPECT_TRUE(json.contains("version"));
  EXPECT_TRUE(json.contains("machine"));
  for (const auto& at : {json, json["rows"][0]}) {
    EXPECT_EQ(at["samples"], 990);
    EXPECT_EQ(at["missed_ticks"], 10);
    EXPECT_NEAR(at["wakeup_p50_us"].get<double>(), 20, 20.0 / 32);
    EXPECT_NEAR(at["wakeup_p99_us"].get<double>(), 50, 50.0 / 32);
    EXPECT_TRUE(at.contains("tick_p50_ns"));
    EXPECT_TRUE(at.contains("tick_p99_ns"));
    EXPECT_EQ(at["samples_acked"], 500);
    EXPECT_EQ(at["spool_left"], 3);
    EXPECT_EQ(at["bytes_per_sample"], 8);
    EXPECT_EQ(at["session_id"], s.session_id);
    EXPECT_EQ(at["score"][0]["measure"], "elapsed_s");
    EXPECT_EQ(at["fault"], nullptr);
    EXPECT_EQ(at["warnings"]["clamping force at its maximum"], 7);
  }
}

TEST(StationSummary, listsTheSyringeEvents) {
  StationSummary s = example();
  EXPECT_EQ(nlohmann::json::parse(summaryJson(s))["syringe"], nullptr);
  EXPECT_THAT(summaryText(s), testing::Not(HasSubstr("syringe")));
  s.syringe_json = "[]";
  EXPECT_THAT(summaryText(s), HasSubstr("syringe      not used"));
  s.syringe_json = R"([{"event": "ASPIRATION", "words": "aspiration of 10 % at 12.3 s, 21 mm deep in BURSA"},
                       {"event": "INJECTION", "words": "injection of 80 %"}])";
  EXPECT_THAT(
      summaryText(s),
      HasSubstr("syringe\n    aspiration of 10 % at 12.3 s, 21 mm deep in BURSA\n    injection of 80 %\n"));
  const auto json = nlohmann::json::parse(summaryJson(s));
  EXPECT_EQ(json["syringe"][0]["event"], "ASPIRATION");
  EXPECT_EQ(json["rows"][0]["syringe"].size(), 2u);
}

TEST(StationSummary, tellsByHowMuchTheNeedleMissed) {
  StationSummary s = example();
  EXPECT_EQ(nlohmann::json::parse(summaryJson(s))["miss"], nullptr) << "no target";
  EXPECT_THAT(summaryText(s), testing::Not(HasSubstr("target   ")));
  s.miss = Miss{Miss::At::kFurthest, false, {}, 0.0039, 0.0021, {"towards the head"}};
  EXPECT_THAT(summaryText(s),
              HasSubstr("target       Missed by 2.1 mm towards the head, 3.9 mm too deep. "
                        "At the furthest point of the last insertion, at the needle's tip.\n"));
  const auto json = nlohmann::json::parse(summaryJson(s));
  for (const auto& at : {json, json["rows"][0]})
    EXPECT_EQ(at["miss"], (nlohmann::json{{"in_target", false},
                                          {"aside_m", 0.0021},
                                          {"too_deep_m", 0.0039},
                                          {"through", nlohmann::json::array()},
                                          {"towards", {"towards the head"}},
                                          {"at", "furthest point"},
                                          {"words", "Missed by 2.1 mm towards the head, 3.9 mm too deep."}}));
  s.miss = Miss{Miss::At::kInjection, true, {}, 0, 0, {}};
  EXPECT_THAT(
      summaryText(s),
      HasSubstr("target       In the target. Where the last injection began, at the needle's opening.\n"));
}

TEST(StationSummary, showsTheRenderedStiffnessNextToTheScore) {
  StationSummary s = example();
  EXPECT_EQ(nlohmann::json::parse(summaryJson(s))["stiffness_share"], 1);
  EXPECT_THAT(summaryText(s), testing::Not(HasSubstr("stiffness    ")));
  s.shares = {0.55, 0.8};
  EXPECT_EQ(nlohmann::json::parse(summaryJson(s))["rows"][0]["stiffness_share"], 0.55);
  EXPECT_EQ(nlohmann::json::parse(summaryJson(s))["rows"][0]["delay_stiffness_share"], 0.8);
  EXPECT_THAT(summaryText(s),
              HasSubstr("stiffness    Fixture, bone, palpation and orientation limit were rendered at 55 %"));
  s.left_out = bitOf(Effect::kBone);
  EXPECT_THAT(summaryText(s), HasSubstr("stiffness    Bone was left out"));
}

TEST(StationSummary, withoutSamplesNothingIsDividedByZero) {
  StationSummary s = example();
  s.servo = {};
  s.writer = {};
  const auto json = nlohmann::json::parse(summaryJson(s));
  EXPECT_EQ(json["bytes_per_sample"], 0);
  EXPECT_EQ(json["score"], nullptr);
  EXPECT_FALSE(summaryText(s).empty());
}

TEST(StationSummary, thePersonReadsWhatRemainsAndWhatWentWrong) {
  StationSummary s = example();
  s.spool_left = 3;
  s.servo.fault = Fault::kDeviceSilent;
  const std::string text = summaryText(s);
  EXPECT_THAT(text, HasSubstr("3 chunks wait in /spool"));
  EXPECT_THAT(text, HasSubstr("10 of 1000 ticks missed"));
  EXPECT_THAT(text, HasSubstr("the device stopped reporting"));
  EXPECT_THAT(text, HasSubstr("clamping force at its maximum: 7 ticks"));
}

TEST(StationSummary, reportsPastFaultsPhasesAndRealTime) {
  StationSummary s = example();
  s.servo.faults = 3;
  s.servo.fault_ticks = 120;
  s.servo.first_fault = Fault::kDeviceSilent;
  s.servo.late_wakeups = 4;
  for (int i = 0; i < 990; ++i) s.servo.record.add(50);
  s.black_box = {5, 2, 1, 2, 7};
  s.realtime = {{"memory lock", true, "x"}, {"stack", true, "x"}, {"FIFO priority", false, "ordinary"}};
  const std::string text = summaryText(s);
  EXPECT_THAT(text, HasSubstr("faults       3, 120 ticks without force; the first: the device stopped"));
  EXPECT_THAT(text, HasSubstr("black box    2 files in /spool/black-box, for 5 faults"));
  EXPECT_THAT(text, HasSubstr("a tick or more late: 4 times"));
  EXPECT_THAT(text,
              HasSubstr("real time    memory lock, stack: done\n             FIFO priority: ordinary\n"));
  const auto json = nlohmann::json::parse(summaryJson(s));
  for (const auto& at : {json, json["rows"][0]}) {
    EXPECT_EQ(at["fault_count"], 3);
    EXPECT_EQ(at["fault_ticks"], 120);
    EXPECT_EQ(at["late_wakeups"], 4);
    EXPECT_EQ(at["record_p50_ns"], 50);
    EXPECT_EQ(at["black_box"]["not_kept"], 2);
    EXPECT_EQ(at["black_box"]["ticks_refused"], 7);
  }
  EXPECT_EQ(nlohmann::json::parse(summaryJson(example()))["first_fault"], nullptr);
}

TEST(StationSummary, eachFaultIsListedWithReasonTimeAndWhetherItWasAcknowledged) {
  StationSummary s = example();
  s.servo.noteFault(Fault::kEmergencyStop, true, 1500);
  s.servo.noteFault(Fault::kEmergencyStop, false, 1501);
  s.servo.noteFault(Fault::kNone, false, 4000);
  s.servo.noteFault(Fault::kDeviceLost, true, 9000);
  s.device_notes = {"ORIENTATION_LIMIT is not live: the device renders no torque."};
  const auto json = nlohmann::json::parse(summaryJson(s));
  ASSERT_EQ(json["faults"].size(), 2u);
  EXPECT_EQ(json["faults"][0], (nlohmann::json{{"reason", "the emergency stop is pressed"},
                                               {"tick", 1500},
                                               {"time_s", 1.5},
                                               {"acknowledged", true},
                                               {"over_s", 4.0}}));
  EXPECT_EQ(json["faults"][1]["acknowledged"], false);
  EXPECT_EQ(json["faults"][1]["over_s"], nullptr);
  EXPECT_EQ(json["device_notes"][0], s.device_notes[0]);
  EXPECT_THAT(summaryText(s), HasSubstr("ORIENTATION_LIMIT is not live"));
}

TEST(StationSummary, moreFaultsThanAreListedAreStillCounted) {
  ServoStats stats;
  for (std::uint64_t k = 0; k < 200; ++k) {
    stats.noteFault(Fault::kDeviceSilent, true, 10 * k);
    stats.noteFault(Fault::kNone, false, 10 * k + 5);
  }
  EXPECT_EQ(stats.fault_note_count, ServoStats::kMaxFaultNotes);
  for (const FaultNote& note : stats.fault_notes) EXPECT_EQ(note.over_tick, note.tick + 5);
}

TEST(StationSummary, everyEngineAndGateFlagHasItsOwnWords) {
  std::set<std::string_view> seen;
  for (unsigned bit = 0; bit <= 11; ++bit) {
    EXPECT_FALSE(flagText(bit).empty()) << bit;
    EXPECT_TRUE(seen.insert(flagText(bit)).second);
  }
  for (unsigned bit = 16; bit <= 30; ++bit) {
    EXPECT_FALSE(flagText(bit).empty()) << bit;
    EXPECT_TRUE(seen.insert(flagText(bit)).second);
  }
  EXPECT_TRUE(flagText(31).empty());
  EXPECT_TRUE(isWarningFlag(21));
  EXPECT_FALSE(isWarningFlag(0));
}

}  // namespace
}  // namespace needlelab

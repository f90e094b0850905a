#include "client/instructor/terminal/update.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <utility>

namespace needlelab {
namespace {

using testing::HasSubstr;
using testing::Not;

GestureSample sample() {
  GestureSample s;
  s.force_W_N[0] = 1;
  s.force_W_N[1] = -2;
  s.force_W_N[2] = 2;
  s.insertion_m = 0.01234;
  s.layer = 2;
  s.phase = 1;
  return s;
}

TEST(UpdateLine, aPersonReadsMillimetresAndNewtons) {
  Update update = updateOf(sample());
  update.time_s = 12.3456;
  update.station = "bench-1";
  update.trainee = "tina";
  update.latency_ms = 7.25;
  update.drops = 3;
  const std::string line = textLine(update);
  for (const char* part :
       {"12.346 s", "bench-1", "tina", "INSERTING", "layer 2", "12.34 mm", "3.000 N", "7.2 ms", "drops 3"}) {
    EXPECT_THAT(line, HasSubstr(part));
  }
}

TEST(UpdateLine, tellsOfTheSyringe) {
  GestureSample before = sample(), now = sample();
  before.plunger = 0.2;
  now.plunger = 0.3;
  now.time_ns = before.time_ns + 200'000'000;
  EXPECT_EQ(syringeAction(before, now), "injecting");
  EXPECT_EQ(syringeAction(before, before), "");
  std::swap(before.plunger, now.plunger);
  EXPECT_EQ(syringeAction(before, now), "aspirating");
  Update update = updateOf(now);
  EXPECT_THAT(textLine(update), HasSubstr("layer 2"));
  EXPECT_THAT(textLine(update), HasSubstr("plunger  20 %"));
  EXPECT_THAT(textLine(update), Not(HasSubstr("aspirating")));
  update.syringe = syringeAction(before, now);
  EXPECT_THAT(textLine(update), HasSubstr("plunger  20 %  aspirating"));
  const auto json = nlohmann::json::parse(jsonLine(update));
  EXPECT_EQ(json["syringe"], "aspirating");
  EXPECT_DOUBLE_EQ(json["plunger"], 0.2);
  // a status line knows of no plunger
  EXPECT_THAT(textLine(updateOf(pb::StationStatus())), Not(HasSubstr("plunger")));
}

TEST(UpdateLine, jsonIsOneLineInSiUnits) {
  Update update = updateOf(sample());
  update.trainee = "a\nb\"";
  const std::string line = jsonLine(update);
  EXPECT_THAT(line, Not(HasSubstr("\n")));
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json["type"], "update");
  EXPECT_EQ(json["trainee"], "a\nb\"");
  EXPECT_DOUBLE_EQ(json["insertion_m"], 0.01234);
  EXPECT_DOUBLE_EQ(json["force_n"], 3);
  EXPECT_EQ(json["layer"], 2);
  EXPECT_FALSE(json.contains("latency_ms"));
}

TEST(UpdateLine, aHostileNameDoesNotReachTheTerminalsControls) {
  Update update = updateOf(sample());
  update.station = "x\x1b[2Jy\n";
  EXPECT_THAT(textLine(update), Not(HasSubstr("\x1b")));
  EXPECT_THAT(noteLine("a\rb", false), Not(HasSubstr("\r")));
}

TEST(UpdateLine, aFaultIsSaidInWords) {
  auto s = sample();
  s.fault = 2;
  EXPECT_THAT(textLine(updateOf(s)), HasSubstr("FAULT: "));
  s.fault = 200;
  s.phase = 77;
  EXPECT_THAT(textLine(updateOf(s)), HasSubstr("FAULT: unknown"));
}

TEST(UpdateLine, whatAStationIsInTroubleWithIsSaid) {
  pb::StationStatus status;
  status.set_station("s1");
  status.set_online(true);
  EXPECT_THAT(textLine(updateOf(status)), Not(HasSubstr("TROUBLE")));
  EXPECT_THAT(jsonLine(updateOf(status)), Not(HasSubstr("trouble")));
  status.set_trouble("the spool's disk is full\x1b[2J");
  EXPECT_THAT(textLine(updateOf(status)),
              AllOf(HasSubstr("idle"), HasSubstr("TROUBLE: the spool's disk is full?[2J")));
  status.set_session_id(std::string(16, '1'));
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("TROUBLE: the spool's disk is full"));
  EXPECT_THAT(jsonLine(updateOf(status)), HasSubstr("\"trouble\":\"the spool's disk is full"));
  status.set_trouble(std::string(1'000'000, 'x'));
  EXPECT_LT(textLine(updateOf(status)).size(), 2000u);
}

TEST(UpdateLine, overviewsTellOfflineAndIdle) {
  pb::StationStatus status;
  status.set_station("bench-1");
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("offline"));
  status.set_online(true);
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("idle"));
  status.set_session_id(std::string(16, '\x01'));
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("FREE"));
}

}  // namespace
}  // namespace needlelab

#include "client/instructor/terminal/update_line.h"

#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

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
       {"12.346 s", "bench-1", "tina", "going in", "layer 3", "12.34 mm", "3.000 N", "7.2 ms", "drops 3"}) {
    EXPECT_THAT(line, HasSubstr(part));
  }
}

TEST(UpdateLine, aKnownLayerIsShownByName) {
  const std::vector<std::string> layers = {"skin", "subcutaneous fat", "dura\x1b[2J"};
  const Update known = updateOf(sample(), layers);
  EXPECT_THAT(textLine(known), HasSubstr("  dura?[2J  insertion"));
  const auto json = nlohmann::json::parse(jsonLine(known));
  EXPECT_EQ(json["layer_name"], "dura\x1b[2J");
  EXPECT_EQ(json["layer"], 2) << "for computers it stays, from 0";
  // the profile has fewer layers or is unknown: counted from 1
  for (const Update& update : {updateOf(sample(), std::span(layers).first(2)), updateOf(sample())}) {
    EXPECT_THAT(textLine(update), HasSubstr("  layer 3  insertion"));
    EXPECT_FALSE(nlohmann::json::parse(jsonLine(update)).contains("layer_name"));
  }
  GestureSample outside = sample();
  outside.layer = -1;
  EXPECT_THAT(textLine(updateOf(outside, layers)), HasSubstr("  outside  insertion"));
  // in an overview the station reports it itself
  pb::StationStatus status;
  status.set_online(true);
  status.set_session_id(std::string(16, '\x01'));
  status.set_layer(1);
  status.set_tissue("subcutaneous fat");
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("  subcutaneous fat  insertion"));
  status.set_tissue(std::string(1'000'000, 'x'));
  EXPECT_LT(textLine(updateOf(status)).size(), 2000u);
}

TEST(UpdateLine, onlyASampleTellsOfThePlunger) {
  GestureSample now = sample();
  now.plunger = 0.2;
  const Update update = updateOf(now);
  EXPECT_THAT(textLine(update), AllOf(HasSubstr("layer 3"), HasSubstr("plunger  20 %")));
  EXPECT_DOUBLE_EQ(nlohmann::json::parse(jsonLine(update))["plunger"], 0.2);
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

TEST(UpdateLine, aStationWithoutALessonHasNoNeedle) {
  // it keeps reporting how its last lesson ended
  pb::StationStatus status;
  status.set_station("bench-1");
  status.set_online(true);
  status.set_phase(1);
  status.set_layer(2);
  status.set_insertion_m(0.0179);
  status.set_session_id(std::string(16, 'a'));
  const auto during = nlohmann::json::parse(jsonLine(updateOf(status)));
  EXPECT_EQ(during["phase"], "going in");
  EXPECT_EQ(during["layer"], 2);
  status.clear_session_id();
  for (const bool online : {true, false}) {
    status.set_online(online);
    const auto json = nlohmann::json::parse(jsonLine(updateOf(status)));
    EXPECT_EQ(json["online"], online);
    for (const char* key : {"phase", "layer", "insertion_m", "force_n"})
      EXPECT_FALSE(json.contains(key)) << key;
  }
}

TEST(UpdateLine, aHostileNameDoesNotReachTheTerminalsControls) {
  Update update = updateOf(sample());
  update.station = "x\x1b[2Jy\n";
  EXPECT_THAT(textLine(update), Not(HasSubstr("\x1b")));
  EXPECT_THAT(noteLine("a\rb", false), Not(HasSubstr("\r")));
}

TEST(UpdateLine, aFaultIsShownInWords) {
  auto s = sample();
  s.fault = 2;
  EXPECT_THAT(textLine(updateOf(s)), HasSubstr("FAULT: "));
  s.fault = 200;
  s.phase = 77;
  EXPECT_THAT(textLine(updateOf(s)), HasSubstr("FAULT: unknown"));
}

TEST(UpdateLine, aStationsTroubleIsShown) {
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

TEST(UpdateLine, theStationsServerIsShownWhenThereAreSeveral) {
  pb::StationStatus status;
  status.set_station("s1");
  status.set_online(true);
  EXPECT_THAT(textLine(updateOf(status)), Not(HasSubstr("server")));
  EXPECT_THAT(jsonLine(updateOf(status)), Not(HasSubstr("server")));
  status.set_server("b\x1b[2J");
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("idle  server b?[2J"));
  EXPECT_EQ(nlohmann::json::parse(jsonLine(updateOf(status)))["server"], "b\x1b[2J");
  status.set_server(std::string(1'000'000, 'x'));
  EXPECT_LT(textLine(updateOf(status)).size(), 300u);
}

TEST(UpdateLine, overviewsTellOfflineAndIdle) {
  pb::StationStatus status;
  status.set_station("bench-1");
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("offline"));
  status.set_online(true);
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("idle"));
  status.set_session_id(std::string(16, '\x01'));
  EXPECT_THAT(textLine(updateOf(status)), HasSubstr("outside"));
}

}  // namespace
}  // namespace needlelab

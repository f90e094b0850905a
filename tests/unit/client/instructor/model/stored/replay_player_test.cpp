#include "client/instructor/model/stored/replay_player.h"

#include <gtest/gtest.h>

#include <limits>

namespace needlelab {
namespace {

ReplayPlayer loaded() {
  ReplayPlayer player;
  player.load(2, 12);
  return player;
}

TEST(ReplayPlayer, playsAtItsSpeedAndStopsAtTheEnd) {
  ReplayPlayer player = loaded();
  player.advance(1);
  EXPECT_EQ(player.at_s(), 2) << "it stands until it is played";
  player.play();
  player.advance(1.5);
  EXPECT_DOUBLE_EQ(player.at_s(), 3.5);
  player.setSpeed(4);
  player.advance(0.5);
  EXPECT_DOUBLE_EQ(player.at_s(), 5.5);
  player.advance(100);
  EXPECT_EQ(player.at_s(), 12);
  EXPECT_FALSE(player.playing());
  player.play();
  EXPECT_EQ(player.at_s(), 2) << "from the end it begins again";
}

TEST(ReplayPlayer, speedsAreHeldAndGoInSteps) {
  ReplayPlayer player = loaded();
  player.setSpeed(0.001);
  EXPECT_EQ(player.speed(), kSlowestReplay);
  player.setSpeed(1000);
  EXPECT_EQ(player.speed(), kFastestReplay);
  player.setSpeed(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(player.speed(), kFastestReplay);
  player.faster();
  EXPECT_EQ(player.speed(), 8);
  for (const double expected : {4.0, 2.0, 1.0, 0.5, 0.25, 0.1, 0.1}) {
    player.slower();
    EXPECT_EQ(player.speed(), expected);
  }
  player.setSpeed(3);
  player.faster();
  EXPECT_EQ(player.speed(), 4);
}

TEST(ReplayPlayer, seeksAndStepsWithinTheGesture) {
  ReplayPlayer player = loaded();
  player.play();
  player.seek(7);
  EXPECT_TRUE(player.playing());
  player.step(-3);
  EXPECT_FALSE(player.playing());
  EXPECT_DOUBLE_EQ(player.at_s(), 7 - 3 * kReplayStep_s);
  player.seek(-5);
  EXPECT_EQ(player.at_s(), 2);
  player.step(-1);
  EXPECT_EQ(player.at_s(), 2);
  player.seek(99);
  EXPECT_EQ(player.at_s(), 12);
}

TEST(ReplayPlayer, aLoopIsPlayedAgainAndAgain) {
  ReplayPlayer player = loaded();
  player.setLoop(ReplayLoop{4, 6});
  player.seek(3);
  player.play();
  player.advance(2.5);  // 5.5
  EXPECT_DOUBLE_EQ(player.at_s(), 5.5);
  player.advance(1);  // 6.5: back to 0.5 in the loop
  EXPECT_DOUBLE_EQ(player.at_s(), 4.5);
  player.advance(7.75);  // 3 rounds and 1.75 further
  EXPECT_NEAR(player.at_s(), 4.25, 1e-9);
  EXPECT_TRUE(player.playing());
  player.setLoop(ReplayLoop{6, 5});
  EXPECT_FALSE(player.loop().has_value()) << "turned round: none";
}

TEST(ReplayPlayer, anEmptyRecordingStaysStill) {
  ReplayPlayer player;
  player.load(std::numeric_limits<double>::quiet_NaN(), 1);
  EXPECT_EQ(player.at_s(), 0);
  player.load(5, 5);
  player.play();
  EXPECT_FALSE(player.playing());
}

}  // namespace
}  // namespace needlelab

#include "client/station/run/lesson/hand_buttons.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

/// `ms` of samples with these buttons, after those so far.
std::vector<GestureSample> samplesOf(std::uint32_t buttons, int ms, std::uint64_t& tick) {
  std::vector<GestureSample> samples(static_cast<std::size_t>(ms));
  for (GestureSample& sample : samples) {
    sample.tick = tick++;
    sample.buttons = buttons;
  }
  return samples;
}

TEST(HandButtons, countWhenBothAreHeldForASecondAndOnceAPress) {
  HandButtons hand(1000);
  std::uint64_t tick = 0;
  const auto press = [&](std::uint32_t buttons, int ms) { return hand.press(samplesOf(buttons, ms, tick)); };
  EXPECT_FALSE(press(0b11, 999));
  EXPECT_FALSE(press(0b01, 1)) << "one was let go";
  EXPECT_FALSE(press(0b11, 1000)) << "held from now on";
  EXPECT_TRUE(press(0b111, 1)) << "a third one does not matter";
  EXPECT_FALSE(press(0b11, 5000)) << "it is one press";
  EXPECT_FALSE(press(0b10, 3000));
  EXPECT_TRUE(press(0b11, 1001));
}

}  // namespace
}  // namespace needlelab

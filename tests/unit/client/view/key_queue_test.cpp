#include "client/view/key_queue.h"

#include <gtest/gtest.h>

#include <string>

namespace needlelab {
namespace {

/// "+a" goes down, "-a" goes up; frames are separated by blanks.
std::string framesOf(const std::string& events) {
  KeyQueue keys;
  for (std::size_t i = 0; i + 1 < events.size(); i += 2) {
    KeyEvent event;
    event.key = events[i + 1];
    event.down = events[i] == '+';
    keys.add(event);
  }
  std::string text;
  for (auto seen = keys.take(); !seen.empty(); seen = keys.take()) {
    if (!text.empty()) text += ' ';
    for (const KeyEvent& event : seen) text += {event.down ? '+' : '-', static_cast<char>(event.key)};
  }
  return text;
}

TEST(KeyQueue, aTapBetweenTwoFramesIsDownForOneFrame) {
  EXPECT_EQ(framesOf("+a-a"), "+a -a");
}

TEST(KeyQueue, eachKeyThatGoesDownHasAFrameOfItsOwn) {
  EXPECT_EQ(framesOf("+a-a+b-b"), "+a -a+b -b");
  EXPECT_EQ(framesOf("+a+b"), "+a +b");
}

TEST(KeyQueue, aModifierIsDownBeforeAndUpAfterItsKey) {
  EXPECT_EQ(framesOf("+c+v-v-c"), "+c +v -v-c");
}

TEST(KeyQueue, theOrderOfAllEventsStays) {
  std::string events, flat;
  for (int i = 0; i < 200; ++i) events += {i % 3 == 0 ? '-' : '+', static_cast<char>('a' + i * 7 % 5)};
  for (const char c : framesOf(events))
    if (c != ' ') flat += c;
  EXPECT_EQ(flat, events);
}

TEST(KeyQueue, anIdleFrameSeesNothing) {
  KeyQueue keys;
  EXPECT_TRUE(keys.take().empty());
}

}  // namespace
}  // namespace needlelab

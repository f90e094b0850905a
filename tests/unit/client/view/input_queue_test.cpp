#include "client/view/input_queue.h"

#include <gtest/gtest.h>

#include <string>

namespace needlelab {
namespace {

using Kind = InputEvent::Kind;

/// "+a" the key goes down, "-a" up; "=a" its text; "(0" a button goes down, ")0" up; ">7" moves the mouse
/// there; "^1" notches of the wheel.
void add(InputQueue& queue, const std::string& events) {
  for (std::size_t i = 0; i + 1 < events.size(); i += 2) {
    const char what = events[i], which = events[i + 1];
    const float number = static_cast<float>(which - '0');
    InputEvent event;
    switch (what) {
      case '+':
      case '-':
        event = {.kind = Kind::kKey, .code = which, .down = what == '+'};
        break;
      case '=':
        event = {.kind = Kind::kCharacter, .code = which};
        break;
      case '(':
      case ')':
        event = {.kind = Kind::kButton, .code = which - '0', .down = what == '('};
        break;
      case '>':
        event = {.kind = Kind::kMove, .x = number};
        break;
      default:
        event = {.kind = Kind::kWheel, .y = number};
    }
    queue.add(event);
  }
}

std::string textOf(const InputEvent& event) {
  switch (event.kind) {
    case Kind::kKey:
      return {event.down ? '+' : '-', static_cast<char>(event.code)};
    case Kind::kCharacter:
      return {'=', static_cast<char>(event.code)};
    case Kind::kButton:
      return {event.down ? '(' : ')', static_cast<char>('0' + event.code)};
    case Kind::kMove:
      return {'>', static_cast<char>('0' + static_cast<int>(event.x))};
    case Kind::kWheel:
      break;
  }
  return {'^', static_cast<char>('0' + static_cast<int>(event.y))};
}

/// What each frame sees until the queue is empty; frames are separated by blanks.
std::string framesOf(InputQueue& queue) {
  std::string text;
  while (!queue.empty()) {
    if (!text.empty()) text += ' ';
    for (const InputEvent& event : queue.take()) text += textOf(event);
  }
  return text;
}

std::string framesOf(const std::string& events) {
  InputQueue queue;
  add(queue, events);
  return framesOf(queue);
}

TEST(InputQueue, aTapBetweenTwoFramesIsDownForOneFrame) {
  EXPECT_EQ(framesOf("+a-a"), "+a -a");
  EXPECT_EQ(framesOf("(0)0"), "(0 )0");
}

TEST(InputQueue, eachKeyPressHasItsOwnFrame) {
  EXPECT_EQ(framesOf("+a-a+b-b"), "+a -a+b -b");
  EXPECT_EQ(framesOf("+a+b"), "+a +b");
}

TEST(InputQueue, aModifierIsDownBeforeAndUpAfterItsKey) {
  EXPECT_EQ(framesOf("+c+v-v-c"), "+c +v -v-c");
}

TEST(InputQueue, aKeyAndItsTextHaveTheSameFrame) {
  EXPECT_EQ(framesOf("+h=h-h+m=m-m+E-E"), "+h=h -h+m=m -m+E -E");
  EXPECT_EQ(framesOf("+a=a=a=a-a"), "+a=a=a=a -a") << "a key that is held";
}

TEST(InputQueue, whatWasWrittenAndSentComesBeforeTheClickAfterIt) {
  EXPECT_EQ(framesOf("=h=m+E-E>5(0)0"), "=h=m+E -E>5(0 )0");
  EXPECT_EQ(framesOf("=h(0)0"), "=h (0 )0") << "a click takes the keyboard from the field";
  EXPECT_EQ(framesOf("(0)0=h+E"), "(0 )0 =h+E") << "and gives it to the one that is clicked";
  EXPECT_EQ(framesOf("(0)0(0)0"), "(0 )0 (0 )0");
}

TEST(InputQueue, aClickIsWhereTheMouseWas) {
  EXPECT_EQ(framesOf(">1(0>2)0>3"), ">1(0 >2)0 >3");
}

TEST(InputQueue, movesAndNotchesShareAFrame) {
  EXPECT_EQ(framesOf(">1>2^1>3^1-w"), ">1>2^1>3^1-w");
  EXPECT_EQ(framesOf("+w>1>2^1"), "+w>1>2^1");
}

TEST(InputQueue, theOrderOfAllEventsStays) {
  const char kinds[] = {'+', '-', '=', '(', ')', '>', '^'};
  std::string events, flat;
  for (int i = 0; i < 700; ++i) events += {kinds[i * 5 % 7], static_cast<char>('0' + i * 3 % 5)};
  for (const char c : framesOf(events))
    if (c != ' ') flat += c;
  EXPECT_EQ(flat, events);
}

TEST(InputQueue, anIdleFrameSeesNothing) {
  InputQueue queue;
  EXPECT_TRUE(queue.take().empty());
}

TEST(InputQueue, aPauseKeepsEverythingForTheFrameAfterIt) {
  InputQueue queue;
  add(queue, "+M=m");
  EXPECT_EQ(queue.take().size(), 2u);
  queue.pause();
  add(queue, "-M+n=n");
  EXPECT_TRUE(queue.take().empty());
  EXPECT_EQ(framesOf(queue), "-M+n=n");
}

TEST(InputQueue, pressesBeforeAFrameWasSeenAreDroppedButNotReleases) {
  InputQueue queue;
  queue.shown(6);
  add(queue, "+w");
  EXPECT_EQ(framesOf(queue), "+w");
  add(queue, "+E=x-E(0>3)0-w");
  queue.dropBefore(8);
  queue.shown(7);
  add(queue, "+E-E");  // while the frame still shows 8
  EXPECT_EQ(framesOf(queue), "-E>3)0 -w-E");
  queue.shown(8);
  add(queue, "+E-E");
  EXPECT_EQ(framesOf(queue), "+E -E");
}

struct Label {
  int place;
  const char* label;
  int meant;
};

TEST(KeyMeant, isByLabelForLettersAndSignsAndByPlaceForDigitsAndOtherScripts) {
  // as glfwGetKeyName gives them on setxkbmap's us, fr, de, us(dvorak), ara
  for (const auto& [place, label, meant] :
       {Label{'W', "w", 'W'}, Label{'W', "z", 'Z'}, Label{'Z', "w", 'W'}, Label{'Y', "z", 'Z'},
        Label{',', "w", 'W'}, Label{'W', ",", ','}, Label{'M', ",", ','}, Label{';', "m", 'M'},
        Label{'1', "&", '1'}, Label{'6', "-", '6'}, Label{'2', "é", '2'}, Label{'1', "١", '1'},
        Label{'W', "ص", 'W'}, Label{'W', nullptr, 'W'}, Label{'W', "", 'W'}, Label{']', "+", '='},
        Label{'/', "-", '-'}, Label{'=', "=", '='}, Label{'[', "ü", '['}})
    EXPECT_EQ(keyMeant(place, label), meant) << static_cast<char>(place) << " " << (label ? label : "-");
}

}  // namespace
}  // namespace needlelab

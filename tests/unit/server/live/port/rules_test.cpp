// The order of the states. permissions_test.cpp tests the messages that each state allows.
#include "server/live/port/rules.h"

#include <gtest/gtest.h>

#include <set>

namespace needlelab {
namespace {

using State = ConnectionState;

constexpr State kStates[] = {State::kConnecting, State::kGreeting, State::kLoggingIn, State::kAuthenticated,
                             State::kInSession,  State::kClosing,  State::kClosed};
TEST(Rules, statesFollowEachOtherOnlyAsDrawn) {
  const std::set<std::pair<State, State>> drawn = {
      {State::kConnecting, State::kGreeting},     {State::kGreeting, State::kLoggingIn},
      {State::kLoggingIn, State::kAuthenticated}, {State::kAuthenticated, State::kInSession},
      {State::kInSession, State::kAuthenticated}, {State::kConnecting, State::kClosing},
      {State::kGreeting, State::kClosing},        {State::kLoggingIn, State::kClosing},
      {State::kAuthenticated, State::kClosing},   {State::kInSession, State::kClosing},
      {State::kConnecting, State::kClosed},       {State::kGreeting, State::kClosed},
      {State::kLoggingIn, State::kClosed},        {State::kAuthenticated, State::kClosed},
      {State::kInSession, State::kClosed},        {State::kClosing, State::kClosed},
  };
  for (const State now : kStates) {
    for (const State next : kStates) {
      EXPECT_EQ(mayFollow(now, next), drawn.contains({now, next})) << nameOf(now) << " -> " << nameOf(next);
    }
  }
}

}  // namespace
}  // namespace needlelab

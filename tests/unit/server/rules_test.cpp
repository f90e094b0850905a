#include "server/rules.h"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

namespace needlelab {
namespace {

using State = ConnectionState;

constexpr State kStates[] = {State::kConnecting, State::kGreeting, State::kLoggingIn, State::kAuthenticated,
                             State::kInSession,  State::kClosing,  State::kClosed};
constexpr pb::Role kRoles[] = {pb::ROLE_UNSPECIFIED,   pb::TRAINEE,       pb::INSTRUCTOR,
                               pb::CURRICULUM_MANAGER, pb::ADMINISTRATOR, pb::STATION};

struct Legal {
  std::string states;  // g greeting, l logging in, a authenticated, s in session
  std::string
      roles;  // - nobody yet, t trainee, i instructor, c curriculum manager, a administrator, s station
};

// the table of proto/README.md, written down a second time; a message that is missing here may never come
// from a peer
const std::map<std::string, Legal> kLegal = {
    {"hello", {"g", "-"}},           {"login", {"l", "-"}},         {"bye", {"glas", "-ticas"}},
    {"refusal", {"glas", "-ticas"}}, {"ping", {"as", "ticas"}},     {"pong", {"as", "ticas"}},
    {"request", {"as", "ticas"}},    {"open_session", {"as", "s"}}, {"chunk", {"s", "s"}},
    {"close_session", {"s", "s"}},   {"clock_offset", {"s", "s"}},  {"live_frame", {"as", "s"}},
    {"station_status", {"as", "s"}}, {"subscribe", {"as", "ica"}},  {"unsubscribe", {"as", "ica"}},
};

char letterOf(State state) {
  switch (state) {
    case State::kGreeting:
      return 'g';
    case State::kLoggingIn:
      return 'l';
    case State::kAuthenticated:
      return 'a';
    case State::kInSession:
      return 's';
    default:
      return '?';
  }
}
char letterOf(pb::Role role) {
  switch (role) {
    case pb::TRAINEE:
      return 't';
    case pb::INSTRUCTOR:
      return 'i';
    case pb::CURRICULUM_MANAGER:
      return 'c';
    case pb::ADMINISTRATOR:
      return 'a';
    case pb::STATION:
      return 's';
    default:
      return '-';
  }
}

TEST(Rules, everyMessageInEveryStateFromEveryRole) {
  const auto* body = pb::Envelope::descriptor()->FindOneofByName("body");
  int allowed = 0, checked = 0;
  for (int i = 0; i < body->field_count(); ++i) {
    const auto* field = body->field(i);
    const auto legal = kLegal.find(field->name());
    for (const State state : kStates) {
      for (const pb::Role role : kRoles) {
        ++checked;
        const Verdict verdict =
            checkMessage(static_cast<pb::Envelope::BodyCase>(field->number()), state, role);
        const std::string what = field->name() + " in " + nameOf(state) + " from " + pb::Role_Name(role);
        if (state == State::kClosing || state == State::kClosed) {
          EXPECT_EQ(verdict, Verdict::kIgnored) << what;
        } else if (legal == kLegal.end()) {
          EXPECT_EQ(verdict, Verdict::kNeverFromPeer) << what;
        } else if (legal->second.states.find(letterOf(state)) == std::string::npos) {
          EXPECT_EQ(verdict, Verdict::kWrongState) << what;
        } else if (legal->second.roles.find(letterOf(role)) == std::string::npos) {
          EXPECT_EQ(verdict, Verdict::kWrongRole) << what;
        } else {
          EXPECT_EQ(verdict, field->name() == "pong" ? Verdict::kIgnored : Verdict::kAllowed) << what;
          ++allowed;
        }
      }
    }
  }
  EXPECT_EQ(checked, body->field_count() * 7 * 6);
  EXPECT_GT(allowed, 50);
}

TEST(Rules, aBodyOfANewerMinorIsUnknownNotFatal) {
  EXPECT_EQ(checkMessage(pb::Envelope::BODY_NOT_SET, State::kAuthenticated, pb::STATION), Verdict::kUnknown);
}

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

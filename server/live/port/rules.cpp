#include "server/live/port/rules.h"

namespace needlelab {
namespace {

using State = ConnectionState;
using Body = pb::Envelope;

constexpr unsigned bit(State state) {
  return 1u << static_cast<unsigned>(state);
}
// proto3 keeps numbers outside the enum: they have no bit
constexpr unsigned bit(pb::Role role) {
  return role >= pb::Role_MIN && role <= pb::Role_MAX ? 1u << static_cast<unsigned>(role) : 0u;
}

constexpr unsigned kLoggedIn = bit(State::kAuthenticated) | bit(State::kInSession);
constexpr unsigned kStation = bit(pb::STATION);
constexpr unsigned kPeople = bit(pb::TRAINEE) | bit(pb::INSTRUCTOR) | bit(pb::CURRICULUM_MANAGER) |
                             bit(pb::ADMINISTRATOR) | bit(pb::RESEARCHER);
constexpr unsigned kWatchers = bit(pb::INSTRUCTOR) | bit(pb::CURRICULUM_MANAGER) | bit(pb::ADMINISTRATOR);
constexpr unsigned kEverybody = kStation | kPeople;
constexpr unsigned kNobodyYet = bit(pb::ROLE_UNSPECIFIED);

struct Rule {
  Body::BodyCase body;
  unsigned states;  // allowed states
  unsigned roles;   // allowed roles
};

// any message that is not listed is illegal from a peer
constexpr Rule kRules[] = {
    {Body::kHello, bit(State::kGreeting), kNobodyYet},
    {Body::kLogin, bit(State::kLoggingIn), kNobodyYet},
    {Body::kBye, bit(State::kGreeting) | bit(State::kLoggingIn) | kLoggedIn, kNobodyYet | kEverybody},
    {Body::kRefusal, bit(State::kGreeting) | bit(State::kLoggingIn) | kLoggedIn, kNobodyYet | kEverybody},
    {Body::kPing, kLoggedIn, kEverybody},
    {Body::kPong, kLoggedIn, kEverybody},
    {Body::kRequest, kLoggedIn, kEverybody},
    {Body::kOpenSession, kLoggedIn, kStation},
    {Body::kChunk, bit(State::kInSession), kStation},
    {Body::kCloseSession, bit(State::kInSession), kStation},
    {Body::kClockOffset, bit(State::kInSession), kStation},
    {Body::kLiveFrame, kLoggedIn, kStation},
    {Body::kStationStatus, kLoggedIn, kStation},
    {Body::kSubscribe, kLoggedIn, kWatchers},
    {Body::kUnsubscribe, kLoggedIn, kWatchers},
};

}  // namespace

const char* nameOf(ConnectionState state) {
  switch (state) {
    case State::kConnecting:
      return "connecting";
    case State::kGreeting:
      return "greeting";
    case State::kLoggingIn:
      return "logging_in";
    case State::kAuthenticated:
      return "authenticated";
    case State::kInSession:
      return "in_session";
    case State::kClosing:
      return "closing";
    case State::kClosed:
      return "closed";
  }
  return "?";
}

bool mayFollow(ConnectionState now, ConnectionState next) {
  if (now == State::kClosed) return false;
  if (next == State::kClosed) return true;
  if (next == State::kClosing) return now != State::kClosing;
  switch (now) {
    case State::kConnecting:
      return next == State::kGreeting;
    case State::kGreeting:
      return next == State::kLoggingIn;
    case State::kLoggingIn:
      return next == State::kAuthenticated;
    case State::kAuthenticated:
      return next == State::kInSession;
    case State::kInSession:
      return next == State::kAuthenticated;
    case State::kClosing:
    case State::kClosed:
      break;
  }
  return false;
}

Verdict checkMessage(pb::Envelope::BodyCase body, ConnectionState state, pb::Role role) {
  if (state == State::kClosing || state == State::kClosed) return Verdict::kIgnored;
  if (body == Body::BODY_NOT_SET) return Verdict::kUnknown;
  for (const Rule& rule : kRules) {
    if (rule.body != body) continue;
    // check the state first: before log-in there is no role
    if ((rule.states & bit(state)) == 0) return Verdict::kWrongState;
    if ((rule.roles & bit(role)) == 0) return Verdict::kWrongRole;
    return body == Body::kPong ? Verdict::kIgnored : Verdict::kAllowed;
  }
  return Verdict::kNeverFromPeer;
}

}  // namespace needlelab

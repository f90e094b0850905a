/// The messages that a peer may send in each connection state and role. Checked before any handler runs.
#pragma once

#include <cstdint>

#include "needlelab/envelope.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// The life of a connection on the server (proto/README.md). It can enter kClosed from every state.
enum class ConnectionState : std::uint8_t {
  kConnecting,     ///< TLS handshake; reads no messages
  kGreeting,       ///< waits for Hello
  kLoggingIn,      ///< Hello was answered; waits for Login
  kAuthenticated,  ///< Welcome was sent
  kInSession,      ///< a station that has opened a session here and not closed it
  kClosing,        ///< the last message is being sent; ignores further input
  kClosed,
};
inline constexpr int kConnectionStates = 7;
const char* nameOf(ConnectionState state);

/// The only place that defines the state transitions.
bool mayFollow(ConnectionState now, ConnectionState next);

enum class Verdict : std::uint8_t {
  kAllowed,
  kIgnored,  ///< harmless but not for the server, or too late: Pong; anything while closing
  kUnknown,  ///< a body unknown to this version
  kWrongState,
  kWrongRole,
  kNeverFromPeer,  ///< only servers send it
};

/// `role` is ROLE_UNSPECIFIED before log-in. The service checks the role for each request
/// (service/requests.h).
Verdict checkMessage(pb::Envelope::BodyCase body, ConnectionState state, pb::Role role);

}  // namespace needlelab

/// The messages that a peer may send, by the state of its connection and its role. Checked before any handler
/// runs.
#pragma once

#include <cstdint>

#include "needlelab/envelope.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// Life of a connection, seen from the server (proto/README.md). It ends in kClosed from every state.
enum class ConnectionState : std::uint8_t {
  kConnecting,     ///< TLS handshake; nothing is read
  kGreeting,       ///< waits for Hello
  kLoggingIn,      ///< Hello was answered; waits for Login
  kAuthenticated,  ///< Welcome was sent
  kInSession,      ///< a station with at least one open session
  kClosing,        ///< the last message is on its way; what still comes is ignored
  kClosed,
};
inline constexpr int kConnectionStates = 7;
const char* nameOf(ConnectionState state);

/// The one place that says which states may follow which.
bool mayFollow(ConnectionState now, ConnectionState next);

enum class Verdict : std::uint8_t {
  kAllowed,
  kIgnored,  ///< harmless and not for us, or too late: Pong; anything while closing
  kUnknown,  ///< no body that this version knows
  kWrongState,
  kWrongRole,
  kNeverFromPeer,  ///< only servers send it
};

/// `role` is ROLE_UNSPECIFIED before log-in. Which requests a role may make is checked by the service
/// (service/requests.h).
Verdict checkMessage(pb::Envelope::BodyCase body, ConnectionState state, pb::Role role);

}  // namespace needlelab

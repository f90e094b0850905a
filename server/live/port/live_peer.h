/// A connection to the port of stations and instructors, as the rest of the server sees it.
#pragma once

#include <cstdint>
#include <string>

#include "common/wire/asio.h"
#include "common/wire/channel.h"
#include "db/service/service.h"
#include "needlelab/envelope.pb.h"
#include "server/live/hub/hub.h"
#include "server/live/port/rules.h"

namespace needlelab {

/// Implemented by PeerConnection. Thread: the network's.
class LivePeer : public HubPeer {
 public:
  [[nodiscard]] virtual std::uint64_t id() const = 0;
  [[nodiscard]] virtual ConnectionState state() const = 0;
  [[nodiscard]] virtual const Principal& who() const = 0;
  [[nodiscard]] virtual const Channel& channel() const = 0;
  [[nodiscard]] virtual bool hasRequests() const = 0;
  [[nodiscard]] bool isLoggingIn() const { return state() == ConnectionState::kLoggingIn; }
  [[nodiscard]] bool over() const { return state() >= ConnectionState::kClosing; }

  /// Sends the refusal as the last message and closes.
  virtual void refuseAndClose(pb::Refusal refusal) = 0;

  /// Closes the connection now, without a last message.
  virtual void cut(const std::string& reason) = 0;

  /// For a stopping server: stops reading, waits until received chunks are committed and acknowledged, sends
  /// Bye.
  virtual void shutDown(const std::string& reason) = 0;

  /// Asks the kernel whether the peer has hung up, because a peer at its limit of requests is not read. Call
  /// periodically while hasRequests().
  virtual void checkHangUp() = 0;

  /// After a verified backup: reports to the station the sessions and chunks that it covers.
  virtual void sendSafe() = 0;

  /// Sends a message and waits until the peer has read it, confirmed by its answer to a Ping sent after it.
  virtual Task<bool> sendConfirmed(pb::Envelope envelope) = 0;
};

}  // namespace needlelab

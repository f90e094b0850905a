/// A client's link to its server, or to any of several: connects, logs in, reconnects after a loss, and
/// matches replies to requests. Used by the station's uplink, the instructor, the commands (BlockingClient)
/// and the load and herd programs.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "client/net/link/link_settings.h"

namespace needlelab {

struct ServerLinkState;

/// With several servers (ClientConfig::others, or a name with several addresses), ServerChoice chooses the
/// one to try. A round tries all without waiting in between; it is a LinkEnd only if none accepts us. A
/// refusal that would be the same at every server (wrong key or password, unknown, too many attempts of a
/// person) ends the round, so that no key or password is tried at all servers in turn.
///
/// Thread: the io_context's single thread, for all functions. The owner may destroy the link at any time
/// outside its handlers: the link then cuts its connection and calls no more handlers.
class ServerLink {
 public:
  using Answer = LinkAnswer;
  static constexpr std::chrono::milliseconds kForever = kLinkForever;

  ServerLink(asio::io_context& io, LinkSettings settings, LinkHandlers handlers);
  ~ServerLink();
  ServerLink(const ServerLink&) = delete;
  ServerLink& operator=(const ServerLink&) = delete;

  /// Connects with this log-in; replaces any earlier one. People enter the password once: reconnections use
  /// the token of the last Welcome while it is valid, and the password if the server refuses the token.
  void logIn(ClientConfig config);
  /// Ends the connection with a Bye; pending requests fail with kUnavailable.
  void logOut(const std::string& reason);
  /// Retries now, without waiting.
  void retryNow();
  /// Sets whether the link reconnects after a loss.
  void reconnect(bool wanted);
  /// Sends the queued messages and a Bye, and closes within the channel's close_grace; pending requests fail
  /// with kFailed. Calls `done` when the connection has closed, or at once without a connection.
  void stop(const std::string& reason, std::function<void()> done = {});

  /// Sends the request (and sets its id) now or on the next connection, and passes the reply to `answer`.
  /// Errors: errorOf(Refusal); kUnavailable after `patience`, after a loss (`on_loss`), or when too many
  /// requests wait; kFailed when the link stops. Returns the request's id.
  std::uint64_t ask(pb::Request request, Answer answer, OnLoss on_loss = OnLoss::kResend,
                    std::chrono::milliseconds patience = std::chrono::seconds(60));
  /// Drops this request: its answer is not called.
  void forget(std::uint64_t id);

  /// False without a connection.
  bool send(const pb::Envelope& envelope);
  /// A live message: dropped if the network is too slow for it. See Channel::sendLive.
  void sendLive(Frame frame, bool counted);
  /// Sends the queued messages and closes; the link reconnects.
  void drop(CloseReason reason, const std::string& text);
  /// Cuts the connection now; the link reconnects.
  void cut(const std::string& text);
  /// Drops this connection if another server may do better (ServerChoice::hasBetter), and connects there.
  /// False without such a server or without a connection.
  bool moveOn(const std::string& why);
  /// Pauses reading for `time`, beginning with the next message.
  void pauseReading(std::chrono::milliseconds time);

  [[nodiscard]] bool online() const;
  [[nodiscard]] const pb::Welcome& welcome() const;  ///< of the last connection
  [[nodiscard]] const Endpoint& server() const;      ///< of the last connection, or else the first
  /// Why other servers did not accept us in the round that made the last connection; empty: none was tried,
  /// or there is only one.
  [[nodiscard]] const std::string& passedOver() const;
  [[nodiscard]] std::uint64_t connections() const;  ///< made so far
  [[nodiscard]] std::size_t waiting() const;        ///< requests without a reply
  [[nodiscard]] std::size_t queuedBytes() const;    ///< unsent control messages
  /// Why the connection ended or is ending, as far as known. Only while not online().
  [[nodiscard]] Error endError() const;

 private:
  std::shared_ptr<ServerLinkState> state_;
};

}  // namespace needlelab

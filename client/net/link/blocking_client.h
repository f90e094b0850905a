/// A ServerLink for programs that do one thing at a time: the admin tool, the instructor in a terminal,
/// tests.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "client/net/link/server_link.h"
#include "common/base/result.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// Owns its io_context, which runs only inside these calls. Time limits use the link's clock, except those of
/// connectClient and the channel below the link, and the up to 200 ms in which a refused connection closes,
/// which use the machine's clock. Thread: one.
class BlockingClient {
 public:
  /// Makes one attempt to connect, at each of the servers until one accepts. Of `settings`, `reconnects` is
  /// ignored. Errors: as connectClient.
  static Result<BlockingClient> connect(const ClientConfig& config, LinkSettings settings = {});
  BlockingClient(BlockingClient&&) noexcept;
  BlockingClient& operator=(BlockingClient&&) noexcept;
  ~BlockingClient();

  /// Reconnects after a loss, with the token of the last log-in or with its password. Retries with growing
  /// waits until it succeeds, nowNs() reaches `until_ns` or `stop` returns true (polled 50 times a second).
  /// Errors: the last attempt's; kDenied and kVersion end it at once.
  Status reconnect(std::int64_t until_ns, const std::function<bool()>& stop);

  /// Sends the request (its id is set here) and waits for its reply. Keeps other incoming messages for
  /// `receive`. Errors: errorOf(Refusal) if the server refuses; kUnavailable if the connection ends or
  /// `timeout` passes.
  Result<pb::Reply> call(pb::Request request, std::chrono::milliseconds timeout = std::chrono::seconds(120));

  /// Returns the next message that is not a reply to `call`; answers Pings itself. Errors: kNotFound on
  /// timeout (the connection stays open); kUnavailable if the connection has ended, with the reason.
  Result<pb::Envelope> receive(std::chrono::milliseconds timeout);

  /// Queues a message; the next call, receive or `finish` sends it. Errors: kUnavailable.
  Status send(const pb::Envelope& envelope);

  /// Sends the queued messages and a Bye, then closes. The destructor does the same, within the channel's
  /// close_grace.
  void finish(const std::string& reason = "done");

  [[nodiscard]] const pb::Welcome& welcome() const;
  [[nodiscard]] const Endpoint& server() const;  ///< the last one that accepted us
  [[nodiscard]] bool connected() const;
  /// The time of the link's clock.
  [[nodiscard]] std::int64_t nowNs() const;

 private:
  struct State;
  explicit BlockingClient(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace needlelab

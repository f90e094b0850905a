/// A ServerLink for programs that do one thing at a time: the admin tool, the instructor in a terminal,
/// tests.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "client/net/server_link.h"
#include "common/base/result.h"
#include "needlelab/envelope.pb.h"

namespace needlelab {

/// Owns its io_context, which runs only inside these calls. Thread: one.
class BlockingClient {
 public:
  using Clock = std::chrono::steady_clock;

  /// Tries once. Errors: as connectClient.
  static Result<BlockingClient> connect(const ClientConfig& config);
  BlockingClient(BlockingClient&&) noexcept;
  BlockingClient& operator=(BlockingClient&&) noexcept;
  ~BlockingClient();

  /// After a loss: tries again, with the token of the last log-in or with its password, and waits longer and
  /// longer, until it succeeds, `until` comes or `stop` says so (asked 50 times a second). Errors: the last
  /// one; kDenied and kVersion end it at once.
  Status reconnect(Clock::time_point until, const std::function<bool()>& stop);

  /// Sends the request (its id is set here) and waits for its reply. Other messages that come meanwhile are
  /// kept for `receive`. Errors: errorOf(Refusal) when the server refuses; kUnavailable when the connection
  /// ends or `timeout` passes.
  Result<pb::Reply> call(pb::Request request, std::chrono::milliseconds timeout = std::chrono::seconds(120));

  /// The next message that is not a reply to `call` (Pings are answered inside). Errors: kNotFound when none
  /// came in time (the connection goes on); kUnavailable when the connection has ended, with the reason.
  Result<pb::Envelope> receive(std::chrono::milliseconds timeout);

  /// Queues a message; it is on its way when the next call, receive or `finish` runs. Errors: kUnavailable.
  Status send(const pb::Envelope& envelope);

  /// Says Bye, sends what is queued and closes. The destructor does it too, in at most the channel's
  /// close_grace.
  void finish(const std::string& reason = "done");

  [[nodiscard]] const pb::Welcome& welcome() const;
  [[nodiscard]] bool connected() const;

 private:
  struct State;
  explicit BlockingClient(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace needlelab

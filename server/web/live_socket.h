/// A viewer of the live page: a WebSocket that is sent the board as it changes. Only for the files that
/// compile Beast.
#pragma once

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>
#include <string>

#include "server/web/web_stream_types.h"

namespace needlelab {

class WebServer;

/// At most one message is under way to a viewer; what changes meanwhile is skipped, so that nothing piles up.
/// Who has not taken a message after live_write_timeout is cut. It ends with the viewer's session. What a
/// viewer sends is not looked at, and more than 4 KiB of it ends the connection.
/// Thread: the network's.
class LiveSocket {
 public:
  /// `token`: of the session. The handshake's request was judged already.
  static std::shared_ptr<LiveSocket> make(std::shared_ptr<WebServer> server, SecureWebStream stream,
                                          std::string token, std::string who);
  virtual ~LiveSocket() = default;
  LiveSocket(const LiveSocket&) = delete;
  LiveSocket& operator=(const LiveSocket&) = delete;

  using Upgrade = boost::beast::http::request<boost::beast::http::string_body>;
  static Task<> run(std::shared_ptr<LiveSocket> self, std::shared_ptr<const Upgrade> request);
  /// Says that the server goes, and ends.
  virtual void stop() = 0;
  virtual void cut() = 0;

 protected:
  LiveSocket() = default;
  virtual Task<> serve(std::shared_ptr<LiveSocket> self, std::shared_ptr<const Upgrade> request) = 0;
};

}  // namespace needlelab

/// One browser's connection: TLS, requests one after the other, limits and time-outs.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "common/wire/asio.h"

namespace needlelab {

class WebServer;

/// Thread: the network's. Ownership: its coroutine.
class WebConnection {
 public:
  static std::shared_ptr<WebConnection> make(std::shared_ptr<WebServer> server, std::uint64_t id,
                                             Tcp::socket socket, std::string address, std::string host_key);
  virtual ~WebConnection() = default;
  WebConnection(const WebConnection&) = delete;
  WebConnection& operator=(const WebConnection&) = delete;

  static Task<> run(std::shared_ptr<WebConnection> self);

  /// A request at work is answered, then it ends; nothing more is read.
  virtual void stop() = 0;
  /// Ends it now.
  virtual void cut() = 0;

 protected:
  WebConnection() = default;
  virtual Task<> serve() = 0;
};

}  // namespace needlelab

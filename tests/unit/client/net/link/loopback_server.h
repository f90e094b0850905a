/// A TLS server on this machine, in its own thread. A derived class defines what it sends on a connection.
#pragma once

#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "common/wire/asio.h"
#include "common/wire/channel.h"
#include "common/wire/tls.h"

namespace needlelab::test {

/// A port of this machine that refuses connections, and that no other program gets while the object lives.
class ClosedPort {
 public:
  ClosedPort() : socket_(io_, Tcp::v4()) { socket_.bind({asio::ip::address_v4::loopback(), 0}); }
  [[nodiscard]] std::uint16_t port() const { return socket_.local_endpoint().port(); }

 private:
  asio::io_context io_;
  Tcp::socket socket_;
};

/// Thread: call the public members from the test's thread.
class LoopbackServer {
 public:
  LoopbackServer(const LoopbackServer&) = delete;
  LoopbackServer& operator=(const LoopbackServer&) = delete;
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }
  /// Sends on all connections in `channels_`.
  void broadcast(const pb::Envelope& envelope) {
    asio::post(io_, [this, envelope] {
      for (const auto& channel : channels_) channel->send(envelope);
    });
  }
  void dropConnections() {
    asio::post(io_, [this] {
      for (const auto& channel : channels_) channel->close(CloseReason::kLocal, "the test cuts it");
      channels_.clear();
    });
  }

 protected:
  /// Listens. `port`: 0 = any.
  explicit LoopbackServer(std::uint16_t port = 0)
      : acceptor_(io_, Tcp::endpoint(asio::ip::address_v4::loopback(), port)) {}
  virtual ~LoopbackServer() = default;
  /// Starts serving. The derived class calls begin() at the end of its constructor and end() at the beginning
  /// of its destructor.
  void begin(TlsContext tls) {
    asio::co_spawn(io_, accept(std::move(tls)), rethrow);
    thread_ = std::thread([this] { io_.run(); });
  }
  void end() {
    io_.stop();
    thread_.join();
  }
  /// Serves one connection, before its handshake. Thread: the server's.
  virtual Task<> serve(std::shared_ptr<Channel> channel) = 0;

  asio::io_context io_{1};
  std::vector<std::shared_ptr<Channel>> channels_;  ///< server's thread only

 private:
  Task<> accept(TlsContext tls) {
    for (;;) {
      auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
      if (error) co_return;
      asio::co_spawn(io_, serve(Channel::make(TlsStream(std::move(socket), *tls), {})), rethrow);
    }
  }

  Tcp::acceptor acceptor_;
  std::thread thread_;
};

}  // namespace needlelab::test

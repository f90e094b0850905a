/// HTTP/1.1 on a port, with TLS or without: accepts, reads requests one after the other within sizes and
/// times, writes the answers. A subclass decides the answers: server/web for browsers, MonitorPort
/// (server/live/monitor.h) for Prometheus and health checks.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>

#include "common/wire/asio.h"
#include "common/wire/tls.h"
#include "server/base/http_message.h"

namespace needlelab {

/// True when the bytes are not a request that can be read; false when the peer is gone or too slow.
bool isBadRequest(const boost::system::error_code& error);
/// The usual answer to it (400, 408, 413, 431); nothing when the peer is gone.
std::optional<HttpAnswer> unreadableAnswer(const boost::system::error_code& error);

struct HttpLimits {
  std::size_t header_bytes = 8u << 10;
  std::size_t body_bytes = 1u << 20;  ///< 0: bodies are not read
  std::size_t requests_per_connection = 1000;
  std::chrono::milliseconds handshake_timeout{10'000};
  std::chrono::milliseconds idle_timeout{60'000};    ///< between two requests
  std::chrono::milliseconds header_timeout{10'000};  ///< from its first byte to its last, however it drips
  std::chrono::milliseconds body_timeout{30'000};
  std::chrono::milliseconds write_timeout{30'000};  ///< for a reply; of a stream, for a piece
  /// Set: one deadline from accept to the last byte, in place of all others.
  std::optional<std::chrono::milliseconds> whole = {};
};

/// A request and the fate of its answer.
struct HttpExchange {
  const HttpRequest& request;
  unsigned status = 0;
  bool sent = false;
  double seconds = 0;  ///< request read to reply written
};

/// One connection, as the server sees it. Thread: the network's. Ownership: its coroutine.
class HttpConnection {
 public:
  HttpConnection() = default;
  virtual ~HttpConnection() = default;
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;
  virtual Task<> serve() = 0;
  /// A request under way is answered, then it ends; nothing more is read.
  virtual void stop() = 0;
  /// Ends it now.
  virtual void cut() = 0;
};

/// Thread: the network's. Ownership: kept alive by its coroutines.
class HttpServer : public std::enable_shared_from_this<HttpServer> {
 public:
  virtual ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  void beginAccepting();
  /// Takes no more connections or requests; what is under way is answered. May be repeated.
  virtual void stop();
  /// Cuts all connections.
  void cut();
  /// Cuts one; unknown ids are no error.
  void cut(std::uint64_t id);
  [[nodiscard]] std::size_t connections() const { return connections_.size(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] bool stopping() const { return stopping_; }
  [[nodiscard]] asio::io_context& io() { return io_; }
  [[nodiscard]] const HttpLimits& limits() const { return limits_; }
  [[nodiscard]] const std::optional<TlsContext>& tls() const { return tls_; }

  // --- for its connections; the subclass decides

  /// A request to its answer. Never fails: errors are answers.
  virtual Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) = 0;
  /// The answer when the bytes are not a request, are too many or come too slowly; nothing: the connection is
  /// cut.
  virtual std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) = 0;
  /// How long a body may be, by the Cookie header; asked before it is read.
  [[nodiscard]] virtual std::size_t bodyLimit(const std::string& cookie) const;
  /// Headers of every answer.
  [[nodiscard]] virtual const HttpHeaders& commonHeaders() const;
  virtual void handshakeFailed() {}
  virtual void answered(const HttpExchange& exchange);
  /// The connection has ended.
  void ended(std::uint64_t id);

 protected:
  HttpServer(asio::io_context& io, Tcp::acceptor acceptor, std::optional<TlsContext> tls, HttpLimits limits);
  /// A connection arrives. False: it is closed unread.
  virtual bool admit(std::uint64_t id, const Tcp::endpoint& peer) = 0;
  virtual void left(std::uint64_t /*id*/) {}

 private:
  void accepted(Tcp::socket socket);

  asio::io_context& io_;
  Tcp::acceptor acceptor_;
  const std::uint16_t port_;
  const std::optional<TlsContext> tls_;
  const HttpLimits limits_;
  std::unordered_map<std::uint64_t, std::weak_ptr<HttpConnection>> connections_;
  std::uint64_t next_id_ = 1;
  bool stopping_ = false;
};

}  // namespace needlelab

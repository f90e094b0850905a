/// An HTTP/1.1 server on a port, with or without TLS. It accepts connections, reads requests one after the
/// other within limits of size and time, and writes the answers. Subclasses compute the answers: server/web
/// for browsers, MonitorPort (server/live/monitor/monitor.h) for Prometheus and health checks.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "common/wire/asio.h"
#include "common/wire/tls.h"
#include "server/base/http_message.h"

namespace needlelab {

/// True when the bytes are not a valid request; false when the peer is gone or too slow.
bool isBadRequest(const boost::system::error_code& error);
/// The usual answer to an unreadable request (400, 408, 413, 431); nothing when the peer is gone.
std::optional<HttpAnswer> unreadableAnswer(const boost::system::error_code& error);

struct HttpLimits {
  std::size_t header_bytes = 8u << 10;
  std::size_t body_bytes = 1u << 20;  ///< 0: the server does not read bodies
  std::size_t requests_per_connection = 1000;
  std::chrono::milliseconds handshake_timeout{10'000};
  std::chrono::milliseconds idle_timeout{60'000};  ///< between two requests
  /// From the header's first byte to its last, however slowly it arrives.
  std::chrono::milliseconds header_timeout{10'000};
  std::chrono::milliseconds body_timeout{30'000};
  std::chrono::milliseconds write_timeout{30'000};  ///< for a reply, or for one piece of a stream
  /// If set, one deadline from accept to the last byte, instead of all others.
  std::optional<std::chrono::milliseconds> whole = {};
};

/// A request and its answer's outcome.
struct HttpExchange {
  const HttpRequest& request;
  unsigned status = 0;
  bool sent = false;
  double seconds = 0;  ///< from the request's last byte read to the reply's last byte written
};

/// One connection as the server sees it. Thread: the network's. Ownership: its coroutine.
class HttpConnection {
 public:
  HttpConnection() = default;
  virtual ~HttpConnection() = default;
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;
  virtual Task<> serve() = 0;
  /// Reads no more requests; ends after the answer to the current one.
  virtual void stop() = 0;
  /// Closes the connection now.
  virtual void cut() = 0;
  /// Nothing is read while a request is being answered. So this asks the kernel whether the client has closed
  /// its side; HttpRequest::gone is true from then on.
  virtual void checkHangUp() = 0;
};

/// Thread: the network's. Ownership: kept alive by its coroutines.
class HttpServer : public std::enable_shared_from_this<HttpServer> {
 public:
  virtual ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  void beginAccepting();
  /// Accepts no more connections and reads no more requests; answers the current ones. May be called
  /// repeatedly.
  virtual void stop();
  /// Cuts all connections.
  void cut();
  /// Cuts one connection; ignores unknown ids.
  void cut(std::uint64_t id);
  /// Finds clients that hung up while their requests were being answered. Call it periodically.
  void checkHangUps();
  [[nodiscard]] std::size_t connections() const { return connections_.size(); }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] bool stopping() const { return stopping_; }
  [[nodiscard]] asio::io_context& io() { return io_; }
  [[nodiscard]] const HttpLimits& limits() const { return limits_; }
  [[nodiscard]] const std::optional<TlsContext>& tls() const { return tls_; }
  /// For new connections; the server must have been created with TLS.
  void useTls(TlsContext tls) { tls_ = std::move(tls); }

  // --- for its connections; implemented by the subclass

  /// Answers a request. Never fails: errors are answers.
  virtual Task<HttpAnswer> answer(std::shared_ptr<HttpRequest> request) = 0;
  /// The answer to an unreadable, too large or too slow request. Nothing: the connection is cut.
  virtual std::optional<HttpAnswer> unreadable(const boost::system::error_code& error) = 0;
  /// Maximum size of a body, from the request line and the Cookie header. Called before the body is read.
  [[nodiscard]] virtual std::size_t bodyLimit(std::string_view method, std::string_view target,
                                              const std::string& cookie) const;
  /// Headers of every answer.
  [[nodiscard]] virtual const HttpHeaders& commonHeaders() const;
  virtual void handshakeFailed() {}
  virtual void answered(const HttpExchange& exchange);
  /// The next piece of an answer could not be made; the connection ends without the rest.
  virtual void streamFailed(const HttpRequest& request, const Error& error);
  /// The connection has ended.
  void ended(std::uint64_t id);

 protected:
  HttpServer(asio::io_context& io, Tcp::acceptor acceptor, std::optional<TlsContext> tls, HttpLimits limits);
  /// Called for a new connection. If false, the server closes it without reading.
  virtual bool admit(std::uint64_t id, const Tcp::endpoint& peer) = 0;
  virtual void left(std::uint64_t /*id*/) {}

 private:
  void accepted(Tcp::socket socket);

  asio::io_context& io_;
  Tcp::acceptor acceptor_;
  const std::uint16_t port_;
  std::optional<TlsContext> tls_;
  const HttpLimits limits_;
  std::unordered_map<std::uint64_t, std::weak_ptr<HttpConnection>> connections_;
  std::uint64_t next_id_ = 1;
  bool stopping_ = false;
};

}  // namespace needlelab

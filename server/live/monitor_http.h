/// A small HTTP server for machines that watch this one: GET /metrics and GET /healthz, without TLS.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

struct HttpAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

/// One request a connection, answered and closed. Everything is bounded: connections, bytes of a request, and
/// the time from accept to close. Thread: the io_context's. Ownership: kept alive by its coroutines; stop()
/// ends them.
class MonitorHttp : public std::enable_shared_from_this<MonitorHttp> {
 public:
  struct Limits {
    std::size_t connections = 16;             ///< more are closed at once
    std::size_t request_bytes = 4096;         ///< request line and headers; a body is refused
    std::chrono::milliseconds whole{10'000};  ///< from accept to the last byte
  };
  /// Gives the answer for a path; asked for GET and HEAD only.
  using Handler = std::function<Task<HttpAnswer>(std::string path)>;

  static std::shared_ptr<MonitorHttp> make(asio::io_context& io, Tcp::acceptor acceptor, Handler handler,
                                           Limits limits);
  ~MonitorHttp();
  MonitorHttp(const MonitorHttp&) = delete;
  MonitorHttp& operator=(const MonitorHttp&) = delete;

  void start();
  /// Closes the listening socket and every connection.
  void stop();
  [[nodiscard]] std::uint16_t port() const;

 private:
  struct State;
  explicit MonitorHttp(std::unique_ptr<State> state);
  static Task<> acceptLoop(std::shared_ptr<MonitorHttp> self);
  static Task<> serve(std::shared_ptr<MonitorHttp> self, std::uint64_t id, Tcp::socket socket);
  std::unique_ptr<State> state_;
};

}  // namespace needlelab

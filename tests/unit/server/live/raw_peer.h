/// A TLS peer without our protocol: sends any bytes in any state of the connection.
#pragma once

#include <poll.h>

#include <chrono>
#include <csignal>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/wire/tls.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {

class RawPeer {
 public:
  /// Connects from another address of this machine if one is given (127.0.0.2 …).
  explicit RawPeer(RunningServer& server, const std::string& from = {})
      : RawPeer(server.server().caFile(), server.server().port(), from) {}
  RawPeer(const std::filesystem::path& ca, std::uint16_t port, const std::string& from = {})
      : tls_(*makeClientTls(ca)), socket_(io_), ssl_(SSL_new(tls_->native_handle()), &SSL_free) {
    if (!from.empty()) {
      socket_.open(Tcp::v4());
      socket_.bind({asio::ip::make_address(from), 0});
    }
    socket_.connect({asio::ip::address_v4::loopback(), port});
    // OpenSSL works on the socket directly, without a buffer, so poll() shows whether data are available.
    SSL_set_fd(ssl_.get(), static_cast<int>(socket_.native_handle()));
    if (SSL_connect(ssl_.get()) != 1) throw std::runtime_error("no TLS with the server");
  }

  static std::string framed(const pb::Envelope& envelope) {
    const std::string body = envelope.SerializeAsString();
    std::string bytes;
    appendFrameHeader(bytes, body.size());
    return bytes + body;
  }
  void write(const std::string& bytes) {
    // The server may have closed already: neither an error nor a signal.
    std::signal(SIGPIPE, SIG_IGN);
    (void)SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size()));
  }
  void send(const pb::Envelope& envelope) { write(framed(envelope)); }

  /// Returns the next message, or nothing if the server closed or nothing arrived in time.
  std::optional<pb::Envelope> receive(milliseconds limit = milliseconds(60'000)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    for (;;) {
      const auto frame = splitter_.next();
      if (!frame.ok()) return std::nullopt;
      if (frame->has_value()) return *decodeFrame(**frame);
      if (SSL_pending(ssl_.get()) == 0) {
        // rounded up: a wait of one millisecond must wait
        const auto left = std::chrono::ceil<milliseconds>(end - std::chrono::steady_clock::now()).count();
        pollfd wait{socket_.native_handle(), POLLIN, 0};
        if (left <= 0 || ::poll(&wait, 1, static_cast<int>(left)) <= 0) return std::nullopt;
      }
      const auto room = splitter_.writable();
      const int count = SSL_read(ssl_.get(), room.data(), static_cast<int>(room.size()));
      if (count <= 0) {
        closed_ = true;
        return std::nullopt;
      }
      splitter_.wrote(static_cast<std::size_t>(count));
    }
  }
  /// Returns all messages until the server closes.
  std::vector<pb::Envelope> readAll() {
    std::vector<pb::Envelope> all;
    while (auto envelope = receive()) all.push_back(std::move(*envelope));
    return all;
  }
  /// Returns true if the server has closed the connection. Valid after a receive() that returned nothing.
  [[nodiscard]] bool closed() const { return closed_; }

  /// Sends Hello and reads the answer.
  void greet() {
    pb::Envelope hello;
    *hello.mutable_hello()->mutable_version() = ourVersion();
    send(hello);
    const auto answer = receive();
    if (!answer || !answer->has_hello()) throw std::runtime_error("the server does not greet");
  }
  /// Sends Hello and log-in. Returns the welcome or the refusal.
  pb::Envelope logIn(const pb::Login& login) {
    greet();
    pb::Envelope envelope;
    *envelope.mutable_login() = login;
    send(envelope);
    const auto answer = receive();
    if (!answer) throw std::runtime_error("the server does not answer a log-in");
    return *answer;
  }
  [[nodiscard]] SSL* ssl() const { return ssl_.get(); }

 private:
  asio::io_context io_;
  TlsContext tls_;
  Tcp::socket socket_;
  std::unique_ptr<SSL, void (*)(SSL*)> ssl_;
  FrameSplitter splitter_{kMaxFrameBytes};
  bool closed_ = false;
};

}  // namespace needlelab::test

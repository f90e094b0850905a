/// A plain HTTPS and WebSocket client for tests: uses sockets and OpenSSL, none of the server's code.
#pragma once

#include <openssl/ssl.h>
#include "tests/support/patience.h"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace needlelab::test {

struct WebReply {
  int status = 0;                              ///< 0: no reply
  std::map<std::string, std::string> headers;  ///< names in lower case
  std::string body;
  [[nodiscard]] std::string header(const std::string& name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? std::string() : found->second;
  }
  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(body, nullptr, false); }
};

/// One connection, with a timeout of 20 s. Does not fail the test itself; the test checks the returned
/// values.
class WebWire {
 public:
  explicit WebWire(std::uint16_t port, bool shake_hands = true);
  ~WebWire();
  WebWire(const WebWire&) = delete;
  WebWire& operator=(const WebWire&) = delete;

  [[nodiscard]] bool connected() const { return fd_ >= 0 && ssl_ != nullptr; }
  bool send(const std::string& bytes);
  bool sendPlain(const std::string& bytes);  ///< sends outside TLS
  /// Sends a TLS KeyUpdate. False: the connection has ended.
  bool changeKeys();
  /// From now on the kernel buffers only some kilobytes of unread data, so that the peer's writes soon wait.
  void keepLittle();
  /// Reads outside TLS until the peer closes.
  std::string receivePlain();
  /// Reads up to `most` bytes. Returns an empty string if the peer closed or nothing arrived in time.
  std::string receive(std::size_t most = 16384);
  /// Returns true if the peer closes.
  bool ends();
  WebReply read(bool head = false);
  /// Reads only the header; readBody() reads the body.
  WebReply readHeader();
  /// Returns the next piece of a chunked body, or nothing at its end. Sets `broken` if the body ended early.
  std::optional<std::string> readChunk(bool& broken);

  // --- WebSocket
  /// Returns a text message, or nothing if the connection ended or `limit` passed.
  std::optional<std::string> readText(std::chrono::milliseconds limit = kPatience);
  bool sendFrame(int opcode, const std::string& payload);
  [[nodiscard]] int closeCode() const { return close_code_; }

 private:
  bool fill();
  void waitAtMost(std::chrono::milliseconds limit);
  int fd_ = -1;
  SSL_CTX* context_ = nullptr;
  SSL* ssl_ = nullptr;
  std::string pending_;
  int close_code_ = 0;
};

using WebHeaders = std::vector<std::pair<std::string, std::string>>;

/// Returns a request's text. Adds length and type of `body` unless `headers` set them.
std::string requestText(const std::string& method, const std::string& path, const std::string& body = {},
                        const WebHeaders& headers = {});

/// A browser with a log-in: sends cookie and token with every request. Each request uses a new connection
/// unless it is kept.
class Browser {
 public:
  explicit Browser(std::uint16_t port) : port_(port) {}

  WebReply ask(const std::string& method, const std::string& path, const std::string& body = {},
               WebHeaders headers = {});
  WebReply get(const std::string& path) { return ask("GET", path); }
  /// Returns the reply to POST /session. Keeps cookie and token on success.
  WebReply logIn(const std::string& name, const std::string& password);
  /// Returns the cookie header and, except for GET, the CSRF token.
  [[nodiscard]] WebHeaders own(const std::string& method) const;
  /// Returns the WebSocket after the handshake. If the server refuses, returns null and sets `refused` to the
  /// reply.
  std::unique_ptr<WebWire> live(WebReply* refused = nullptr, const std::string& origin = "https://localhost");

  std::string cookie, csrf;

 private:
  std::uint16_t port_;
  std::unique_ptr<WebWire> wire_;
};

}  // namespace needlelab::test

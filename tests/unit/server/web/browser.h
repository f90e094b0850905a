/// A plain HTTPS and WebSocket client of the tests: sockets and OpenSSL, nothing of the server's own code.
#pragma once

#include <openssl/ssl.h>

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
  int status = 0;                              ///< 0: there was none
  std::map<std::string, std::string> headers;  ///< names in small letters
  std::string body;
  [[nodiscard]] std::string header(const std::string& name) const {
    const auto found = headers.find(name);
    return found == headers.end() ? std::string() : found->second;
  }
  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(body, nullptr, false); }
};

/// One connection. Times out after 20 s. Fails the test that uses it only by what it gives back.
class WebWire {
 public:
  explicit WebWire(std::uint16_t port, bool shake_hands = true);
  ~WebWire();
  WebWire(const WebWire&) = delete;
  WebWire& operator=(const WebWire&) = delete;

  [[nodiscard]] bool connected() const { return fd_ >= 0 && ssl_ != nullptr; }
  bool send(const std::string& bytes);
  bool sendPlain(const std::string& bytes);  ///< past TLS
  /// Past TLS, all until the peer closes.
  std::string receivePlain();
  /// Up to `most` bytes; empty: the peer has ended it, or nothing came in time.
  std::string receive(std::size_t most = 16384);
  /// The peer closes within `limit`.
  bool endsWithin(std::chrono::milliseconds limit);
  WebReply read(bool head = false);
  /// Header only; the body is left to readBody().
  WebReply readHeader();
  /// The next piece of a chunked body; nothing at its end; `broken` when it ended before that.
  std::optional<std::string> readChunk(bool& broken);

  // --- WebSocket
  /// A text message; nothing when it ended or `limit` passed.
  std::optional<std::string> readText(std::chrono::milliseconds limit = std::chrono::milliseconds(10'000));
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

/// A request's text. `body` with its length and type, unless `headers` say otherwise.
std::string requestText(const std::string& method, const std::string& path, const std::string& body = {},
                        const WebHeaders& headers = {});

/// A browser with a log-in: cookie and token go with every request, each on a new connection unless it is
/// kept.
class Browser {
 public:
  explicit Browser(std::uint16_t port) : port_(port) {}

  WebReply ask(const std::string& method, const std::string& path, const std::string& body = {},
               WebHeaders headers = {});
  WebReply get(const std::string& path) { return ask("GET", path); }
  /// The reply to POST /session; keeps cookie and token when it went well.
  WebReply logIn(const std::string& name, const std::string& password);
  /// The cookie and, beside GET, the CSRF token.
  [[nodiscard]] WebHeaders own(const std::string& method) const;
  /// After the handshake; null when it was refused, then `refused` has the reply.
  std::unique_ptr<WebWire> live(WebReply* refused = nullptr, const std::string& origin = "https://localhost");

  std::string cookie, csrf;

 private:
  std::uint16_t port_;
  std::unique_ptr<WebWire> wire_;
};

}  // namespace needlelab::test

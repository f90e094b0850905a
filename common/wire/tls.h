/// TLS 1.3 with a private CA: contexts, the check of the peer's name, and an engine without a socket.
#pragma once

#include <openssl/ssl.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/wire/asio.h"

namespace needlelab {

/// Shared by all connections of a program; immutable once made.
using TlsContext = std::shared_ptr<asio::ssl::context>;
using TlsStream = asio::ssl::stream<Tcp::socket>;

/// Errors: kInvalidInput naming the file that is missing, unreadable, or does not fit the other.
Result<TlsContext> makeServerTls(const std::filesystem::path& certificate, const std::filesystem::path& key);

/// Trusts `ca` and nothing else. Errors: kInvalidInput naming the file.
Result<TlsContext> makeClientTls(const std::filesystem::path& ca);

/// Before the handshake of a client: the server's certificate must be for `host` (a name or an IP address).
Status requireHost(TlsStream& stream, const std::string& host);

/// What the last TLS failure was, in words: e.g. "certificate verify failed (self-signed certificate)".
std::string tlsErrorText(const SSL* ssl, std::string text);

/// Why a call of TlsEngine came to its end.
enum class TlsStep : std::uint8_t {
  kDone,        ///< the handshake is complete; so many bytes were read or written
  kWantsInput,  ///< everything that was fed is used up
  kEnded,       ///< the peer said that it sends nothing more
  kFailed,      ///< TLS broke: hostile or damaged bytes, a certificate that is not trusted
};

/// What was fed is used up by the next handshake(), or by read() until it wants input: TLS keeps at most one
/// unfinished record (17 KiB). Thread: one.
class TlsEngine {
 public:
  /// Takes a share of `ssl` and replaces its way to the network.
  explicit TlsEngine(SSL* ssl);
  TlsEngine(const TlsEngine&) = delete;
  TlsEngine& operator=(const TlsEngine&) = delete;
  ~TlsEngine();

  /// Bytes of the network; they must live until they are used up.
  void feed(ByteView bytes) { input_ = bytes; }
  /// True while read() has something to work on.
  [[nodiscard]] bool hasInput() const { return !input_.empty() || SSL_pending(ssl_.get()) > 0; }

  TlsStep handshake(bool as_server);
  /// Decrypts into `room` (not empty) and sets `count`, 0 unless kDone.
  TlsStep read(std::span<std::uint8_t> room, std::size_t& count);
  /// Encrypts all of `plain` into output().
  TlsStep write(std::string_view plain);

  /// Bytes for the network. The owner sends them and calls sent().
  [[nodiscard]] std::string_view output() const { return std::string_view(output_).substr(sent_); }
  void sent(std::size_t count);

  [[nodiscard]] SSL* ssl() const { return ssl_.get(); }
  /// OpenSSL's words for the last kFailed.
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  struct Bio;  // the callbacks that OpenSSL calls
  struct Free {
    void operator()(SSL* ssl) const { SSL_free(ssl); }
  };
  TlsStep stepOf(int result);

  std::unique_ptr<SSL, Free> ssl_;
  ByteView input_;
  std::string output_;
  std::size_t sent_ = 0;  // of output_
  std::string failure_;
};

}  // namespace needlelab

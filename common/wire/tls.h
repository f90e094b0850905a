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

/// Keeps OpenSSL from freeing itself when a program calls `exit`, which it does even while a thread still
/// sends. For programs in which a library may call `exit` (Xlib, when its display is lost). Call it before
/// any other use of TLS and certificates; later it has no effect.
void keepTlsAtExit();

/// Errors: kInvalidInput with the file that is missing, unreadable, or does not match the other.
Result<TlsContext> makeServerTls(const std::filesystem::path& certificate, const std::filesystem::path& key);

/// Trusts `ca` only. Errors: kInvalidInput with the file.
Result<TlsContext> makeClientTls(const std::filesystem::path& ca);

/// A client calls this before the handshake: the server's certificate must then be valid for `host` (a name
/// or an IP address).
Status requireHost(TlsStream& stream, const std::string& host);

/// A connection's peer may change its keys this often, plus once for each kBytesOfKeys that the connection
/// carries in both directions. One more change ends the connection, on either port: TLS stops reading. Our
/// programs never change keys; other TLS libraries do so after gigabytes.
inline constexpr std::uint64_t kMaxKeyUpdates = 4;
inline constexpr std::uint64_t kBytesOfKeys = 1u << 20;

/// Maximum bytes, including headers, of a peer's records until the handshake is done; beyond it the
/// connection ends, on either port. Our programs need less than 2 KiB. OpenSSL alone would accept a first
/// message of 128 KiB, and records of one byte: 65 kB of those took the network thread 7.5 ms.
inline constexpr std::uint64_t kMaxHandshakeBytes = 32u << 10;

/// How often the peer has changed its keys, i.e. the number of KeyUpdates read (RFC 8446, 4.6.3). `ssl` must
/// be from a TlsContext.
std::uint64_t keyUpdatesOf(const SSL* ssl);

/// Describes the last TLS failure, e.g. "certificate verify failed (self-signed certificate)".
std::string tlsErrorText(const SSL* ssl, std::string text);

/// The result of a call of TlsEngine.
enum class TlsStep : std::uint8_t {
  kDone,        ///< the handshake is complete, or bytes were read or written
  kWantsInput,  ///< all fed bytes are consumed
  kEnded,       ///< the peer announced the end of its data
  kFailed,      ///< TLS failed: hostile or damaged bytes, an untrusted certificate, too long a handshake
};

/// TLS without a socket. The next handshake(), or read() until it returns kWantsInput, consumes all fed
/// bytes: TLS keeps at most one unfinished record (17 KiB). Thread: one.
class TlsEngine {
 public:
  /// Takes a reference to `ssl` and replaces its network I/O.
  explicit TlsEngine(SSL* ssl);
  TlsEngine(const TlsEngine&) = delete;
  TlsEngine& operator=(const TlsEngine&) = delete;
  ~TlsEngine();

  /// Feeds bytes from the network; they must stay valid until they are consumed.
  void feed(ByteView bytes) {
    input_ = bytes;
    Bytes().swap(kept_);
  }
  /// Copies the fed bytes that are not yet consumed, so that the caller's buffer need not stay valid.
  void keepInput();
  /// True while read() has input to process.
  [[nodiscard]] bool hasInput() const { return !input_.empty() || SSL_pending(ssl_.get()) > 0; }

  TlsStep handshake(bool as_server);
  /// Decrypts into `room` (not empty) and sets `count`, 0 unless kDone.
  TlsStep read(std::span<std::uint8_t> room, std::size_t& count);
  /// Encrypts all of `plain` into output().
  TlsStep write(std::string_view plain);

  /// Returns the bytes for the network. The owner sends them and calls sent().
  [[nodiscard]] std::string_view output() const { return std::string_view(output_).substr(sent_); }
  void sent(std::size_t count);

  [[nodiscard]] SSL* ssl() const { return ssl_.get(); }
  /// OpenSSL's error text for the last kFailed.
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  struct Bio;  // the callbacks that OpenSSL calls
  struct Free {
    void operator()(SSL* ssl) const { SSL_free(ssl); }
  };
  TlsStep stepOf(int result);

  std::unique_ptr<SSL, Free> ssl_;
  ByteView input_;
  Bytes kept_;  // what input_ views after keepInput()
  std::string output_;
  std::size_t sent_ = 0;  // bytes of output_ already sent
  std::string failure_;
};

}  // namespace needlelab

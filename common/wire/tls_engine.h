/// TLS without a socket: the network's bytes go in and come out by hand, so that the owner decides how many
/// system calls and copies a message costs.
#pragma once

#include <openssl/ssl.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "common/base/bytes.h"

namespace needlelab {

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

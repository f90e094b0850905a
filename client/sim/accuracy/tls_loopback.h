/// A station's live plane in one process: frames through a TLS connection on 127.0.0.1, both ends on one
/// thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "common/base/result.h"
#include "common/wire/protocol.h"

namespace needlelab {

/// Two channels of common/wire with a certificate made for the purpose in a temporary folder, which is
/// removed again. Thread: one.
class TlsLoopback {
 public:
  /// Errors: kFailed or kUnavailable with the reason (no port, no folder, TLS).
  static Result<std::unique_ptr<TlsLoopback>> open();
  ~TlsLoopback();
  TlsLoopback(const TlsLoopback&) = delete;
  TlsLoopback& operator=(const TlsLoopback&) = delete;

  /// Sends a live frame and runs both ends until it has arrived. Errors: kUnavailable when it does not within
  /// 5 s.
  Result<pb::Envelope> pass(Frame frame);
  /// Bytes that the sender's TLS has written so far: records with their headers and tags, without those of
  /// TCP and IP.
  [[nodiscard]] std::uint64_t cipherBytes() const;

 private:
  TlsLoopback();
  struct Ends;
  std::unique_ptr<Ends> ends_;
};

}  // namespace needlelab

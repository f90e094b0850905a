/// The hash that proves that station, server and recording have the same gesture (proto/README.md).
#pragma once

#include <sodium.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

using Digest = std::array<std::uint8_t, 32>;

/// BLAKE2b-256 (RFC 7693, no key) over the chunks' bytes in order. Copyable: a copy continues on its own.
class SessionHash {
 public:
  SessionHash();
  void update(ByteView chunk);
  /// Returns the hash of all bytes so far; more bytes may follow.
  [[nodiscard]] Digest digest() const;

 private:
  crypto_generichash_state state_;
};

/// 64 lower-case hexadecimal digits.
std::string hexOf(const Digest& digest);
/// Errors: kInvalidInput when `hex` is not 64 hexadecimal digits.
Result<Digest> digestFromHex(std::string_view hex);

}  // namespace needlelab

#include "common/gesture/chunk.h"

#include "common/base/text/text.h"

namespace needlelab {

SessionHash::SessionHash() {
  crypto_generichash_init(&state_, nullptr, 0, Digest{}.size());
}

void SessionHash::update(ByteView chunk) {
  crypto_generichash_update(&state_, chunk.data(), chunk.size());
}

Digest SessionHash::digest() const {
  crypto_generichash_state copy = state_;
  Digest digest{};
  crypto_generichash_final(&copy, digest.data(), digest.size());
  return digest;
}

std::string hexOf(const Digest& digest) {
  return hexDigitsOf(textOf(digest));
}

Result<Digest> digestFromHex(std::string_view hex) {
  Digest digest{};
  bool good = hex.size() == 2 * digest.size();
  for (std::size_t i = 0; good && i < digest.size(); ++i) {
    const int high = hexDigit(hex[2 * i]), low = hexDigit(hex[2 * i + 1]);
    good = high >= 0 && low >= 0;
    digest[i] = static_cast<std::uint8_t>((high << 4) | (low & 15));
  }
  if (!good)
    return Error{ErrorCode::kInvalidInput,
                 "a session hash is 64 hexadecimal digits; '" + std::string(hex.substr(0, 80)) + "' is not"};
  return digest;
}

}  // namespace needlelab

#include "db/login/login_key.h"

#include <sodium.h>

#include <algorithm>

namespace needlelab {
namespace {

constexpr std::size_t kRandomBytes = 16, kTokenBytes = 32;

std::string sealOf(const LoginKey& key, std::string_view random) {
  const auto hash = key.of("token", random);
  return std::string(textOf(ByteView(hash).first(kTokenBytes - kRandomBytes)));
}

}  // namespace

LoginKey::Hash LoginKey::of(std::string_view purpose, std::string_view text) const {
  Bytes bytes;
  ByteWriter writer(bytes);
  writer.put(static_cast<std::uint64_t>(purpose.size()));
  writer.put(viewOf(purpose));
  writer.put(viewOf(text));
  Hash hash{};
  crypto_generichash(hash.data(), hash.size(), bytes.data(), bytes.size(), key_.data(), key_.size());
  return hash;
}

std::string LoginKey::makeToken() const {
  std::string token(kRandomBytes, '\0');
  randombytes_buf(token.data(), token.size());
  return token + sealOf(*this, token);
}

bool LoginKey::madeToken(std::string_view token) const {
  if (token.size() != kTokenBytes) return false;
  const std::string seal = sealOf(*this, token.substr(0, kRandomBytes));
  return sodium_memcmp(seal.data(), token.data() + kRandomBytes, seal.size()) == 0;
}

LoginKey::Hash LoginKey::hashOfToken(std::string_view token) {
  Hash hash{};
  crypto_generichash(hash.data(), hash.size(), reinterpret_cast<const unsigned char*>(token.data()),
                     token.size(), nullptr, 0);
  return hash;
}

}  // namespace needlelab

#include "db/password.h"

#include <sodium.h>

#include <cstring>

namespace needlelab {
namespace {

/// libsodium must be initialised once, by whichever thread comes first.
void initialise() {
  static const int rc = sodium_init();
  (void)rc;  // fails only without a source of random numbers; then the calls below fail
}

/// What an empty hash is compared with: a hash of random bytes that nobody knows.
const std::string& decoyHash() {
  static const std::string hash = [] {
    std::array<char, 32> secret;
    randombytes_buf(secret.data(), secret.size());
    std::string text(crypto_pwhash_STRBYTES, '\0');
    if (crypto_pwhash_str(text.data(), secret.data(), secret.size(), crypto_pwhash_OPSLIMIT_INTERACTIVE,
                          crypto_pwhash_MEMLIMIT_INTERACTIVE) != 0) {
      return std::string();
    }
    return text;
  }();
  return hash;
}

}  // namespace

Result<std::string> hashPassword(std::string_view password) {
  initialise();
  if (password.size() < kMinPasswordBytes || password.size() > kMaxPasswordBytes) {
    return Error{ErrorCode::kInvalidInput, "password: has " + std::to_string(password.size()) +
                                               " bytes, allowed are " + std::to_string(kMinPasswordBytes) +
                                               " to " + std::to_string(kMaxPasswordBytes)};
  }
  std::string hash(crypto_pwhash_STRBYTES, '\0');
  if (crypto_pwhash_str(hash.data(), password.data(), password.size(), crypto_pwhash_OPSLIMIT_INTERACTIVE,
                        crypto_pwhash_MEMLIMIT_INTERACTIVE) != 0) {
    return Error{ErrorCode::kFailed, "cannot hash a password: not enough memory (64 MiB are needed)"};
  }
  hash.resize(std::strlen(hash.c_str()));
  return hash;
}

bool verifyPassword(std::string_view hash, std::string_view password) {
  initialise();
  const bool usable =
      !hash.empty() && hash.size() < crypto_pwhash_STRBYTES && password.size() <= kMaxPasswordBytes;
  std::string padded(usable ? hash : std::string_view(decoyHash()));
  padded.resize(crypto_pwhash_STRBYTES, '\0');
  const std::string_view tried = password.substr(0, kMaxPasswordBytes);
  return crypto_pwhash_str_verify(padded.data(), tried.data(), tried.size()) == 0 && usable;
}

StationKeyBytes makeStationKey() {
  initialise();
  StationKeyBytes key;
  randombytes_buf(key.data(), key.size());
  return key;
}

StationKeyBytes hashStationKey(const StationKeyBytes& key) {
  initialise();
  StationKeyBytes hash;
  crypto_generichash(hash.data(), hash.size(), key.data(), key.size(), nullptr, 0);
  return hash;
}

bool sameHash(const StationKeyBytes& a, const StationKeyBytes& b) {
  return sodium_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace needlelab

/// The secret for log-ins that a lab's servers share.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "db/people/pseudonyms.h"

namespace needlelab {

/// Derived from the lab's pseudonym.key, which is in each server's folder. Thread: immutable.
class LoginKey {
 public:
  using Hash = PseudonymKey::Hash;
  explicit LoginKey(const PseudonymKey& lab) : key_(lab.derived("log-ins")), id_(lab.id()) {}

  /// Distinguishes the lab's key from others (PseudonymKey::id).
  [[nodiscard]] const std::string& labKeyId() const { return id_; }
  /// Keyed BLAKE2b-256: without the key, the text cannot be guessed from it. Each purpose gives other hashes.
  [[nodiscard]] Hash of(std::string_view purpose, std::string_view text) const;

  /// 32 bytes: 16 random ones, and 16 that let each server of the lab recognise its own tokens, so that other
  /// input costs no database look-up.
  [[nodiscard]] std::string makeToken() const;
  /// Whether one of the lab's servers made the token, valid or not.
  [[nodiscard]] bool madeToken(std::string_view token) const;
  /// The stored form of a token: BLAKE2b-256, as in Tokens.
  static Hash hashOfToken(std::string_view token);

 private:
  Hash key_;
  std::string id_;
};

}  // namespace needlelab

/// The secret that servers of one lab share for log-ins.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/bytes.h"
#include "db/pseudonyms.h"

namespace needlelab {

/// Made of the lab's pseudonym.key, which each server's folder has. Thread: immutable.
class LoginKey {
 public:
  using Hash = PseudonymKey::Hash;
  explicit LoginKey(const PseudonymKey& lab) : key_(lab.derived("log-ins")), id_(lab.id()) {}

  /// Tells the lab's key from others (PseudonymKey::id).
  [[nodiscard]] const std::string& labKeyId() const { return id_; }
  /// Keyed BLAKE2b-256: one cannot guess what it is of without the key. Other purposes, other hashes.
  [[nodiscard]] Hash of(std::string_view purpose, std::string_view text) const;

  /// 32 bytes: 16 at random, and as many by which each server of the lab sees that one of them made it. So
  /// what is no token costs no look into the database.
  [[nodiscard]] std::string makeToken() const;
  /// Whether a server of the lab made it, be it valid or not.
  [[nodiscard]] bool madeToken(std::string_view token) const;
  /// What the database has of a token: BLAKE2b-256, as Tokens has it.
  static Hash hashOfToken(std::string_view token);

 private:
  Hash key_;
  std::string id_;
};

}  // namespace needlelab

/// Hashed passwords of people and codes of trainees (argon2id), hashed station keys, and the stations
/// themselves. Never logged.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

// --- the cost of hashing a password

/// For argon2id.
struct PasswordCost {
  std::uint64_t operations = 0;
  std::size_t memory_bytes = 0;
};

/// For user programs: libsodium's interactive limits, about 0.1 s.
inline constexpr PasswordCost kPasswordCost{2, std::size_t{64} << 20};

/// The cost of this program's new hashes. In user programs always kPasswordCost, which nothing can change at
/// run time: only test programs link tests/support/store/password_cost.cpp. A hash contains its own cost, so
/// any program can verify it. Thread: any.
PasswordCost passwordCost() noexcept;

inline constexpr std::size_t kMinPasswordBytes = 8;
inline constexpr std::size_t kMaxPasswordBytes = 256;

/// For everyone but trainees, because they see other people's data. Longer passwords are harder to remember
/// without much gain against a server that allows five guesses; shorter ones are in guessers' lists.
inline constexpr std::size_t kMinStaffPasswordBytes = 10;

/// Refuses a password that a guesser tries first: shorter than kMinStaffPasswordBytes, one of the most common
/// ones (in any case, also followed by digits or punctuation), a repeated or counted-up character, the
/// person's own name. kInvalidInput.
Status checkStaffPassword(std::string_view password, std::string_view name);

/// Argon2id (libsodium's crypto_pwhash_str, interactive limits: 64 MiB, about 0.1 s). Blocks for that time:
/// never call it on the network's or the database writer's thread. Errors: kInvalidInput (too short, too
/// long), kFailed (out of memory).
Result<std::string> hashPassword(std::string_view password);

// A trainee's code: a PIN, or what a badge reader types. Easy to guess, so service/code_guard.h limits the
// attempts.
/// Like hashPassword, for a code; digits of any script are digits. Errors: those of checkCode
/// (common/base/text/text.h), kFailed (out of memory).
Result<std::string> hashCode(std::string_view code);
/// Six random decimal digits, each number equally likely.
std::string makePin();

/// True if the password or code matches the hash; takes as long as hashing. An empty hash never matches but
/// takes the same time, so that an attacker cannot tell an unknown name from a wrong password. Errors:
/// kFailed (out of memory; the result is unknown).
Result<bool> verifyPassword(std::string_view hash, std::string_view password);

using StationKeyBytes = std::array<std::uint8_t, 32>;

/// 32 random bytes from the operating system.
StationKeyBytes makeStationKey();
/// BLAKE2b-256 of a key. The key is random, so a fast hash is enough.
StationKeyBytes hashStationKey(const StationKeyBytes& key);
/// Compares in constant time.
bool sameHash(const StationKeyBytes& a, const StationKeyBytes& b);

/// A station: its name and the hash of a random key. Stations are revoked, never deleted, because sessions
/// refer to them.
struct Station {
  std::string name;
  StationKeyBytes key_hash{};
  bool revoked = false;
  std::int64_t created_unix_ns = 0;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class StationStore {
 public:
  explicit StationStore(Connection& connection) : connection_(connection) {}

  /// Adds a station, or gives a revoked one a new key. Errors: kInvalidInput (name), kAlreadyExists (in use).
  Status add(std::string_view name, const StationKeyBytes& key_hash, std::int64_t now_unix_ns);
  /// kNotFound.
  Status revoke(std::string_view name);
  /// Nothing if there is no such station.
  Result<std::optional<Station>> find(std::string_view name);
  /// Whether the station exists, is not revoked, and the key matches (compared in constant time).
  Result<bool> checkKey(std::string_view name, std::string_view key);
  /// Sorted by name.
  Result<std::vector<Station>> list();

 private:
  Connection& connection_;
};

}  // namespace needlelab

/// Passwords of people (argon2id) and keys of stations, hashed. Nothing here is ever logged.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

inline constexpr std::size_t kMinPasswordBytes = 8;
inline constexpr std::size_t kMaxPasswordBytes = 256;

/// Argon2id (libsodium's crypto_pwhash_str, interactive limits: 64 MiB, about 0.1 s). Blocks that long: never
/// on the network's or the database writer's thread. Errors: kInvalidInput (too short, too long), kFailed (no
/// memory).
Result<std::string> hashPassword(std::string_view password);

/// Whether the password belongs to the hash; takes as long as hashing. An empty hash belongs to no password,
/// but takes the same time, so that an unknown name cannot be told from a wrong password.
bool verifyPassword(std::string_view hash, std::string_view password);

using StationKeyBytes = std::array<std::uint8_t, 32>;

/// 32 random bytes of the operating system.
StationKeyBytes makeStationKey();
/// BLAKE2b-256 of a key. The key is random, so a fast hash is enough.
StationKeyBytes hashStationKey(const StationKeyBytes& key);
/// Compares in constant time.
bool sameHash(const StationKeyBytes& a, const StationKeyBytes& b);

}  // namespace needlelab

/// The cost of hashing a password.
#pragma once

#include <cstddef>
#include <cstdint>

namespace needlelab {

/// Of argon2id.
struct PasswordCost {
  std::uint64_t operations = 0;
  std::size_t memory_bytes = 0;
};

/// In programs for users: libsodium's interactive limits, about 0.1 s.
inline constexpr PasswordCost kPasswordCost{2, std::size_t{64} << 20};

/// The cost of this program's new hashes. Always kPasswordCost in programs for users, and nothing at run time
/// can change that: only test programs link tests/support/password_cost.cpp. A hash names its own cost, so
/// any program verifies it. Thread: any.
PasswordCost passwordCost() noexcept;

}  // namespace needlelab

/// The cost of hashing a password.
#pragma once

#include <cstddef>
#include <cstdint>

namespace needlelab {

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

}  // namespace needlelab

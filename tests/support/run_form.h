/// A test run's settings in the environment: its form and its seed.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace needlelab::test {

/// NEEDLELAB_LONG=1 asks for the long form of the tests that have one (deploy/nightly).
inline bool longForm() {
  const char* const form = std::getenv("NEEDLELAB_LONG");
  return form != nullptr && std::string_view(form) == "1";
}

/// NEEDLELAB_SEED, or `usual`. Printed, so that every run can be repeated.
inline std::uint64_t seedOr(std::uint64_t usual) {
  const char* const given = std::getenv("NEEDLELAB_SEED");
  const std::uint64_t seed = given != nullptr ? std::strtoull(given, nullptr, 10) : usual;
  std::printf("NEEDLELAB_SEED=%llu\n", static_cast<unsigned long long>(seed));
  return seed;
}

}  // namespace needlelab::test

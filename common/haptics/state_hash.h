/// The hash of a state, to which each effect with a state of its own adds (EffectEntry::hash).
#pragma once

#include <bit>
#include <cstdint>

#include "common/haptics/geometry.h"

namespace needlelab {

/// 64-bit FNV-1a.
class StateHash {
 public:
  void add(std::uint64_t word) {
    for (int byte = 0; byte < 8; ++byte) {
      hash_ ^= (word >> (8 * byte)) & 0xFFu;
      hash_ *= 0x100000001B3ull;
    }
  }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  void add(Vec3 v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  [[nodiscard]] std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325ull;
};

}  // namespace needlelab

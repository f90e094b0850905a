// The layers along a line have the same bits in debug and release builds, with every compiler: a recording
// stores stacks, and a station, a replay and a viewer each march on their own.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>

#include "common/anatomy/march.h"
#include "tests/support/anatomy/fields.h"

namespace needlelab::test {
namespace {

TEST(Determinism, stacksOfAField) {
  const Field field = fieldOf(forearm());
  Random random(77);
  std::uint64_t hash = 0xCBF29CE484222325;  // FNV-1a over words
  const auto add = [&](std::uint64_t word) { hash = (hash ^ word) * 0x100000001B3; };
  for (int i = 0; i < 2'000; ++i) {
    const Line line = randomLine(random);
    const std::optional<double> entry_m = findEntry(field, line.from_m, line.axis, 0.05);
    if (!entry_m) continue;
    const LayerStack stack = march(field, line.from_m + line.axis * *entry_m, line.axis, {.reach_m = 0.04});
    for (std::size_t k = 0; k < stack.count; ++k) {
      add(stack.layers[k].structure);
      add(std::bit_cast<std::uint64_t>(stack.layers[k].top_m));
    }
    add(static_cast<std::uint64_t>(stack.end));
    add(std::bit_cast<std::uint64_t>(stack.end_m));
  }
  EXPECT_EQ(hash, 397990076883894195u);
}

}  // namespace
}  // namespace needlelab::test

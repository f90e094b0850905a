// The entry points for libFuzzer; one program per target (NEEDLELAB_FUZZ_TARGET).
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "tests/fuzz/target.h"

namespace {
// Chosen at compile time: only this target's code is linked, so libFuzzer reads only its counters.
constexpr needlelab::fuzz::Target kTarget =
    *std::find_if(std::begin(needlelab::fuzz::kTargets), std::end(needlelab::fuzz::kTargets),
                  [](const auto& t) { return t.name == NEEDLELAB_FUZZ_TARGET; });
}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  kTarget.run({data, size});
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (kTarget.mutate != nullptr && seed % 2 == 0)
    if (const std::size_t count = kTarget.mutate({data, max_size}, size, seed); count > 0) return count;
  std::size_t count = LLVMFuzzerMutate(data, size, max_size);
  if (kTarget.repair == nullptr) return count;
  // One input in eight keeps its wrong checksum, to test that path too. One in 16 ends anywhere, as after a
  // crash.
  if (seed % 8 == 0) return count;
  if (seed / 8 % 16 == 0) count = 1 + seed / 128 % count;
  kTarget.repair({data, count}, seed >> 24);
  return count;
}

// The entry points that libFuzzer calls; one program a target (NEEDLELAB_FUZZ_TARGET).
#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "target.h"

namespace {
const needlelab::fuzz::Target& target() {
  static const auto& found =
      *std::find_if(std::begin(needlelab::fuzz::kTargets), std::end(needlelab::fuzz::kTargets),
                    [](const auto& t) { return t.name == NEEDLELAB_FUZZ_TARGET; });
  return found;
}
}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  target().run({data, size});
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  const std::size_t count = LLVMFuzzerMutate(data, size, max_size);
  // one in eight keeps its broken check: that path is code, too
  if (target().repair != nullptr && seed % 8 != 0) target().repair({data, count});
  return count;
}

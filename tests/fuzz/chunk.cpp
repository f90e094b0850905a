// Fuzzes a chunk as a station sends it and as spools, databases and recordings store it.
#include <array>
#include <cstring>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "common/gesture/sample.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {

// bit 0: also sets the last tick to that of a chunk without missed ticks
void repairChunk(std::span<std::uint8_t> data, unsigned how) {
  if (data.size() < 8) return;
  if ((how & 1) != 0 && data.size() >= 28) {
    std::uint16_t samples_less_one = 0;
    std::uint64_t tick = 0;
    std::memcpy(&samples_less_one, data.data() + 6, sizeof samples_less_one);
    std::memcpy(&tick, data.data() + 8, sizeof tick);
    tick += samples_less_one;
    std::memcpy(data.data() + 16, &tick, sizeof tick);
  }
  const std::uint32_t crc = crc32c(ByteView(data).first(data.size() - 4));
  std::memcpy(data.data() + data.size() - 4, &crc, 4);
}

void chunk(ByteView data) {
  const auto info = inspectChunk(data);
  const auto samples = decodeChunk(data);
  require(checkChunk(data).ok() == samples.ok(), "the check says what the decoder says");
  if (!samples.ok()) return;
  require(info.ok(), "what decodes can be inspected");
  require(samples->size() == info->count && !samples->empty() && samples->size() <= kMaxChunkSamples,
          "as many samples as the header says");
  require(samples->front().tick == info->first_tick && samples->back().tick == info->last_tick,
          "ticks as in the header");
  if (kPlanted) {
    // The planted fault: a number of the header is used as an unchecked index.
    static std::array<std::uint8_t, 65536> seen{};
    surely(seen.data()[info->first_tick]) = 1;
  }
  // Any decoded values can be encoded again, and come back bit for bit if nothing is rounded.
  const Bytes cuts = cutMemoryOf(data);
  const Bytes paths = pathListOf(data);
  require((info->version != 1 || cuts.empty()) && (info->version != 2 || !cuts.empty()) &&
              cuts.size() <= kMaxCutMemoryBytes,
          "version 2 has a memory, and a short one");
  require(paths.empty() == (info->version < 3) && paths.size() <= kMaxPathsBytes, "version 3 has paths");
  const Bytes again = encodeChunk(Resolution{0, 0, 0, 0, 0, 0}, *samples, cuts, paths);
  require(cutMemoryOf(again) == cuts && pathListOf(again) == paths, "memory and paths come back");
  const auto back = decodeChunk(again);
  require(back.ok() && back->size() == samples->size(), "decoded samples can be encoded");
  require(std::memcmp(&back->front().p_WT_m, &samples->front().p_WT_m, sizeof back->front().p_WT_m) == 0,
          "without rounding they come back");
  std::string text;
  appendSampleCsvRow(text, samples->back(), info->first_time_ns);
  require(!text.empty() && text.back() == '\n', "a row of CSV");
}

}  // namespace needlelab::fuzz

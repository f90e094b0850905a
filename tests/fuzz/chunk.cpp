// A chunk, as a station sends it and as it lies in spools, databases and recordings.
#include <array>
#include <cstring>

#include "base/crc32c.h"
#include "gesture/chunk.h"
#include "gesture/sample_csv.h"
#include "target.h"

namespace needlelab::fuzz {

void repairChunk(std::span<std::uint8_t> data) {
  if (data.size() < 8) return;
  const std::uint32_t crc = crc32c(ByteView(data).first(data.size() - 4));
  std::memcpy(data.data() + data.size() - 4, &crc, 4);
}

void chunk(ByteView data) {
  const auto info = inspectChunk(data);
  const auto samples = decodeChunk(data);
  if (!samples.ok()) return;
  require(info.ok(), "what decodes can be inspected");
  require(samples->size() == info->count && !samples->empty() && samples->size() <= kMaxChunkSamples,
          "as many samples as the header says");
  require(samples->front().tick == info->first_tick && samples->back().tick == info->last_tick,
          "ticks as in the header");
  if (kPlanted) {
    // the fault: a chunk of a second is believed to have at most 1024 samples
    std::array<std::uint64_t, 1024> ticks{};
    for (std::size_t i = 0; i < samples->size(); ++i) ticks.data()[i] = (*samples)[i].tick;
    require(ticks.data()[0] == info->first_tick, "ticks");
  }
  // whatever the values are, they can be encoded again, and come back bit for bit when nothing is rounded
  const Bytes again = encodeChunk(Resolution{0, 0, 0, 0, 0, 0}, *samples);
  const auto back = decodeChunk(again);
  require(back.ok() && back->size() == samples->size(), "decoded samples can be encoded");
  require(std::memcmp(&back->front().p_WT_m, &samples->front().p_WT_m, sizeof back->front().p_WT_m) == 0,
          "without rounding they come back");
  std::string text;
  appendSampleCsvRow(text, samples->back(), info->first_time_ns);
  require(!text.empty() && text.back() == '\n', "a row of CSV");
}

}  // namespace needlelab::fuzz

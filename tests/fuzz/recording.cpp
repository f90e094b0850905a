// Fuzzes a recording file: complete, cut off, damaged.
#include <array>
#include <cstring>

#include "common/base/bytes.h"
#include "common/gesture/recording.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

constexpr std::array<std::uint8_t, 4> kMarker{0xA7, 'N', 'L', 'r'};

void putCrc(std::span<std::uint8_t> at, ByteView of) {
  const std::uint32_t crc = crc32c(of);
  std::memcpy(at.data(), &crc, 4);
}

}  // namespace

// Written from FORMAT.md, independently of the reader's code.
void repairRecording(std::span<std::uint8_t> data, unsigned how) {
  if (data.size() < 16) return;
  putCrc(data.subspan(12, 4), ByteView(data).first(12));
  std::size_t at = 16;
  while (at + 20 <= data.size() && std::memcmp(data.data() + at, kMarker.data(), 4) == 0) {
    putCrc(data.subspan(at + 12, 4), ByteView(data).subspan(at, 12));
    std::uint32_t length = 0;
    std::memcpy(&length, data.data() + at + 8, 4);
    if (length > data.size() - at - 20) return;
    const auto content = data.subspan(at + 16, length);
    if (data[at + 4] == 2) repairChunk(content, how);
    putCrc(data.subspan(at + 16 + length, 4), content);
    at += 20 + length;
  }
  if (data.size() - at == 24) putCrc(data.subspan(at + 12, 4), ByteView(data).subspan(at, 12));
}

void recording(ByteView data) {
  const auto file = scratchFolder() / "fuzz.rec";
  writeFile(file, data);
  const auto reader = RecordingReader::open(file);
  if (!reader.ok()) return;
  require(reader->metadata().size() <= kMaxRecordingMetadata, "the metadata is bounded");
  require(reader->entries().size() <= data.size() / 20 + 1, "no more chunks than fit into the file");
  const bool whole = reader->verify().ok();
  std::uint64_t samples = 0;
  bool all_readable = true;
  for (std::size_t i = 0; i < reader->entries().size(); ++i) {
    const auto& entry = reader->entries()[i];
    if (kPlanted && entry.offset > 16) {
      // The planted fault: an offset from the file is not checked.
      samples += surely(data.data()[entry.offset + entry.bytes + 20]);
    }
    const auto bytes = reader->chunkBytes(i);
    const auto some = reader->samples(i);
    all_readable = all_readable && some.ok();
    if (some.ok()) {
      require(bytes.ok() && bytes->size() == entry.bytes, "a chunk's bytes are as many as its entry says");
      require(some->size() == entry.count, "a chunk has as many samples as its entry says");
      samples += some->size();
    }
  }
  if (whole) require(all_readable, "a recording that verifies can be read");
  (void)samples;
}

}  // namespace needlelab::fuzz

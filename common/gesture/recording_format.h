/// Constants of FORMAT.md for the writer and the reader of recordings. Internal to common/gesture.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "common/base/bytes.h"
#include "common/gesture/recording.h"

namespace needlelab::recording_format {

inline constexpr std::array<std::uint8_t, 8> kMagic{0x89, 'N', 'L', 'R', 'E', 'C', '\r', '\n'};
inline constexpr std::array<std::uint8_t, 8> kEndMagic{0x89, 'N', 'L', 'E', 'N', 'D', '\r', '\n'};
inline constexpr std::array<std::uint8_t, 4> kMarker{0xA7, 'N', 'L', 'r'};
inline constexpr std::uint16_t kMajor = 1, kMinor = 0;

inline constexpr std::size_t kStartBytes = 16;         ///< magic, version, CRC
inline constexpr std::size_t kRecordHeaderBytes = 16;  ///< marker, kind, reserved, length, CRC
inline constexpr std::size_t kRecordCrcBytes = 4;      ///< after the content
inline constexpr std::size_t kFooterBytes = 24;        ///< offset of the index, reserved, CRC, end magic
inline constexpr std::size_t kIndexEntryBytes = 32;
/// The maximum length of a record: enough for the index of 2²¹ chunks, more than three weeks at one chunk per
/// second.
inline constexpr std::size_t kMaxRecordBytes = 64u << 20;
static_assert(kMaxChunkBytes <= kMaxRecordBytes && kMaxRecordingMetadata <= kMaxRecordBytes);

/// Append-only. Readers skip unknown kinds; 128 and above are for private use.
enum RecordKind : std::uint8_t { kMetadata = 1, kChunk = 2, kIndex = 3 };

inline void putStart(Bytes& out) {
  ByteWriter writer(out);
  writer.put(ByteView(kMagic));
  writer.put(kMajor);
  writer.put(kMinor);
  writer.put(crc32c(ByteView(out).first(12)));
}

inline void putRecord(Bytes& out, std::uint8_t kind, ByteView content) {
  const std::size_t at = out.size();
  ByteWriter writer(out);
  writer.put(ByteView(kMarker));
  writer.put(kind);
  writer.put(std::uint8_t{0});
  writer.put(std::uint16_t{0});
  writer.put(static_cast<std::uint32_t>(content.size()));
  writer.put(crc32c(ByteView(out).subspan(at, 12)));
  writer.put(content);
  writer.put(crc32c(content));
}

inline void putFooter(Bytes& out, std::uint64_t index_offset) {
  const std::size_t at = out.size();
  ByteWriter writer(out);
  writer.put(index_offset);
  writer.put(std::uint32_t{0});
  writer.put(crc32c(ByteView(out).subspan(at, 12)));
  writer.put(ByteView(kEndMagic));
}

struct RecordHeader {
  std::uint8_t kind = 0;
  std::uint32_t length = 0;
};

/// True when the 16 bytes are a record's header: marker and CRC agree, and the length is possible.
inline bool readRecordHeader(ByteView bytes, RecordHeader& header) {
  if (bytes.size() < kRecordHeaderBytes || std::memcmp(bytes.data(), kMarker.data(), kMarker.size()) != 0)
    return false;
  ByteReader in(bytes.subspan(kMarker.size()));
  header.kind = in.get<std::uint8_t>();
  in.take(3);
  header.length = in.get<std::uint32_t>();
  return in.get<std::uint32_t>() == crc32c(bytes.first(12)) && header.length <= kMaxRecordBytes;
}

}  // namespace needlelab::recording_format

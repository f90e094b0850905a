/// Reads Protobuf's wire format field by field, without a message object. Safe for any bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace needlelab {

enum class WireKind : std::uint8_t { kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5 };

/// A field as encoded on the wire.
struct WireField {
  int number = 0;
  WireKind kind = WireKind::kVarint;
  std::uint64_t value = 0;  ///< of a varint
  std::string_view bytes;   ///< of kBytes; a view into the input
};

/// Reads from the front of the bytes, which must outlive it. Every function returns false when the bytes end
/// too early or do not match; the reader is then unusable.
class WireReader {
 public:
  explicit WireReader(std::string_view bytes) : at_(bytes.data()), end_(at_ + bytes.size()) {}
  [[nodiscard]] bool atEnd() const { return at_ == end_; }
  bool byte(std::uint8_t& value) {
    if (at_ == end_) return false;
    value = static_cast<std::uint8_t>(*at_++);
    return true;
  }
  bool varint(std::uint64_t& value) {
    value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      std::uint8_t part = 0;
      if (!byte(part)) return false;
      if (shift == 63 && part > 1) return false;  // more than 64 bits
      value |= static_cast<std::uint64_t>(part & 0x7f) << shift;
      if ((part & 0x80) == 0) return true;
    }
    return false;
  }
  bool bytes(std::string_view& value) {
    std::uint64_t size = 0;
    if (!varint(size) || size > static_cast<std::uint64_t>(end_ - at_)) return false;
    value = {at_, static_cast<std::size_t>(size)};
    at_ += size;
    return true;
  }
  /// Reads the next field as a whole. Does not support groups, which proto3 does not have.
  bool field(WireField& field) {
    std::uint64_t tag = 0;
    if (!varint(tag) || tag >> 3 == 0 || tag > UINT32_MAX) return false;
    field.number = static_cast<int>(tag >> 3);
    field.kind = static_cast<WireKind>(tag & 7);
    switch (field.kind) {
      case WireKind::kVarint:
        return varint(field.value);
      case WireKind::kFixed64:
        return skip(8);
      case WireKind::kBytes:
        return bytes(field.bytes);
      case WireKind::kFixed32:
        return skip(4);
    }
    return false;
  }

 private:
  bool skip(std::ptrdiff_t count) {
    if (end_ - at_ < count) return false;
    at_ += count;
    return true;
  }

  const char *at_, *end_;
};

}  // namespace needlelab

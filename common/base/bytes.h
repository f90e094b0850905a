/// Bounded little-endian reading and writing; the bytes are not trusted. The reader does not allocate.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace needlelab {

using Bytes = std::vector<std::uint8_t>;
using ByteView = std::span<const std::uint8_t>;

static_assert(std::endian::native == std::endian::little, "the codecs copy integers as little-endian bytes");

inline ByteView viewOf(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
inline std::string_view textOf(ByteView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Appends fixed-size integers and floats, little-endian, to a byte vector that it does not own.
class ByteWriter {
 public:
  explicit ByteWriter(Bytes& out) : out_(out) {}
  template <typename T>
  requires std::is_arithmetic_v<T>
  void put(T value) {
    const auto at = out_.size();
    out_.resize(at + sizeof(T));
    std::memcpy(out_.data() + at, &value, sizeof(T));
  }
  void put(ByteView bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }

 private:
  Bytes& out_;
};

/// Reads what ByteWriter wrote. After the first read past the end every read gives zero and `ok()` is false.
class ByteReader {
 public:
  explicit ByteReader(ByteView in) : in_(in) {}
  template <typename T>
  requires std::is_arithmetic_v<T> T get() {
    T value{};
    if (const ByteView raw = take(sizeof(T)); ok_) std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  ByteView take(std::size_t count) {
    if (!ok_ || count > in_.size() - at_) {
      ok_ = false;
      return {};
    }
    const ByteView part = in_.subspan(at_, count);
    at_ += count;
    return part;
  }
  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t position() const { return at_; }
  [[nodiscard]] std::size_t left() const { return in_.size() - at_; }

 private:
  ByteView in_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

// --- CRC-32C (Castagnoli)

/// Returns the CRC of `bytes`; to continue, pass the CRC of the preceding bytes. Check value:
/// crc32c("123456789") = 0xE3069283.
std::uint32_t crc32c(ByteView bytes, std::uint32_t previous = 0) noexcept;

/// Portable version for processors without the CRC instruction; a test compares both.
std::uint32_t crc32cByTables(ByteView bytes, std::uint32_t previous = 0) noexcept;

}  // namespace needlelab

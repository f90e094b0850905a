/// The 16-byte packets of the Falcon's firmware in both directions, and the bytes that the USB chip adds.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace needlelab::falcon {

/// `<`, 12 nibbles of three int16 (least significant nibble first, each + 0x41), byte 13 bits + 0x41, byte 14
/// unused, `>`.
inline constexpr std::size_t kPacketBytes = 16;
using Packet = std::array<std::uint8_t, kPacketBytes>;

/// To the device: one write, one reply.
struct Command {
  std::array<std::int16_t, 3> motor{};  ///< held to ±kMotorMax by `encodeCommand`
  std::uint8_t bits = 0;                ///< kOutHome, kOutGreen, kOutBlue, kOutRed
  friend bool operator==(const Command&, const Command&) = default;
};

/// From the device.
struct Report {
  std::array<std::int16_t, 3> encoder{};
  std::uint8_t bits = 0;  ///< kInButtons, kInHomed
  friend bool operator==(const Report&, const Report&) = default;
};

Packet encodeCommand(const Command& command) noexcept;
/// Encodes as the device does; for tests and emulated devices.
Packet encodeReport(const Report& report) noexcept;

/// Strict: returns false, and leaves the result unchanged, when the format does not allow a byte. Does not
/// check byte 14: its meaning is not documented.
bool decodeReport(const Packet& packet, Report& report) noexcept;
bool decodeCommand(const Packet& packet, Command& command) noexcept;

/// Finds packets in a stream of bytes that may begin anywhere and lose bytes. A `<` always begins a new
/// packet, since it cannot occur within one.
class PacketReader {
 public:
  /// Returns true when `byte` completes a good report.
  bool push(std::uint8_t byte, Report& report) noexcept;
  /// Drops an incomplete packet.
  void reset() noexcept { used_ = 0; }

  [[nodiscard]] std::uint64_t good() const noexcept { return good_; }
  /// Bad packets: cut off, too long, or with an invalid byte.
  [[nodiscard]] std::uint64_t bad() const noexcept { return bad_; }
  /// Bytes outside any packet.
  [[nodiscard]] std::uint64_t stray() const noexcept { return stray_; }
  [[nodiscard]] std::uint32_t badInARow() const noexcept { return bad_in_a_row_; }

 private:
  void reject() noexcept;

  Packet packet_{};
  std::size_t used_ = 0;
  std::uint64_t good_ = 0, bad_ = 0, stray_ = 0;
  std::uint32_t bad_in_a_row_ = 0;
};

/// FTDI's chip starts each USB packet with two status bytes of its serial line: a read of several packets has
/// them every `kUsbPacketBytes`.
inline constexpr std::size_t kUsbPacketBytes = 64, kModemBytes = 2;

/// Calls `each(byte)` for the bytes of `read` except the chip's own.
template <typename Each>
void eachPayloadByte(std::span<const std::uint8_t> read, Each&& each) {
  for (std::size_t i = 0; i < read.size(); ++i)
    if (i % kUsbPacketBytes >= kModemBytes) each(read[i]);
}

}  // namespace needlelab::falcon

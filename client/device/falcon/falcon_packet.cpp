#include "client/device/falcon/falcon_packet.h"

#include <algorithm>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::falcon {
namespace {

constexpr std::uint8_t kBegin = '<', kEnd = '>', kBase = 0x41;
constexpr std::size_t kBitsByte = 13, kSpareByte = 14, kEndByte = 15;
constexpr std::uint8_t kOutBits = kOutHome | kOutGreen | kOutBlue | kOutRed;
constexpr std::uint8_t kInBits = kInButtons | kInHomed;

Packet encode(const std::array<std::int16_t, 3>& values, std::uint8_t bits) noexcept {
  Packet packet{};
  packet[0] = kBegin;
  std::size_t at = 1;
  for (const std::int16_t value : values)
    for (unsigned shift = 0; shift < 16; shift += 4)
      packet[at++] = static_cast<std::uint8_t>(kBase + ((static_cast<std::uint16_t>(value) >> shift) & 0xFu));
  packet[kBitsByte] = static_cast<std::uint8_t>(kBase + bits);
  packet[kSpareByte] = kBase;
  packet[kEndByte] = kEnd;
  return packet;
}

bool decode(const Packet& packet, std::uint8_t allowed_bits, std::array<std::int16_t, 3>& values,
            std::uint8_t& bits) noexcept {
  if (packet[0] != kBegin || packet[kEndByte] != kEnd) return false;
  std::array<std::int16_t, 3> found{};
  std::size_t at = 1;
  for (std::int16_t& value : found) {
    unsigned raw = 0;
    for (unsigned shift = 0; shift < 16; shift += 4) {
      const unsigned nibble = static_cast<unsigned>(packet[at++]) - kBase;
      if (nibble > 0xF) return false;
      raw |= nibble << shift;
    }
    value = static_cast<std::int16_t>(static_cast<std::uint16_t>(raw));
  }
  const unsigned found_bits = static_cast<unsigned>(packet[kBitsByte]) - kBase;
  if (found_bits > 0xFF || (found_bits & ~static_cast<unsigned>(allowed_bits)) != 0) return false;
  values = found;
  bits = static_cast<std::uint8_t>(found_bits);
  return true;
}

}  // namespace

Packet encodeCommand(const Command& command) noexcept {
  std::array<std::int16_t, 3> held{};
  for (std::size_t i = 0; i < 3; ++i)
    held[i] = static_cast<std::int16_t>(std::clamp<int>(command.motor[i], -kMotorMax, kMotorMax));
  return encode(held, command.bits & kOutBits);
}

Packet encodeReport(const Report& report) noexcept {
  return encode(report.encoder, report.bits & kInBits);
}

bool decodeReport(const Packet& packet, Report& report) noexcept {
  return decode(packet, kInBits, report.encoder, report.bits);
}

bool decodeCommand(const Packet& packet, Command& command) noexcept {
  return decode(packet, kOutBits, command.motor, command.bits);
}

void PacketReader::reject() noexcept {
  used_ = 0;
  ++bad_;
  if (bad_in_a_row_ < 0xFFFF'FFFFu) ++bad_in_a_row_;
}

bool PacketReader::push(std::uint8_t byte, Report& report) noexcept {
  // the start of another packet means that this one was cut off
  if (byte == kBegin) {
    if (used_ != 0) reject();
    packet_[0] = byte;
    used_ = 1;
    return false;
  }
  if (used_ == 0) {
    ++stray_;
    return false;
  }
  packet_[used_++] = byte;
  if (used_ < kPacketBytes) return false;
  if (!decodeReport(packet_, report)) {
    reject();
    return false;
  }
  used_ = 0;
  ++good_;
  bad_in_a_row_ = 0;
  return true;
}

}  // namespace needlelab::falcon

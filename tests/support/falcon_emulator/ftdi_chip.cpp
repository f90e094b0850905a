#include "tests/support/falcon_emulator/ftdi_chip.h"

#include "client/device/falcon/falcon_packet.h"

namespace needlelab::test {

bool FtdiChip::control(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
  if (request == 0 && value < 2) to_host_.clear();
  return board_.request(request, value, index);
}

bool FtdiChip::out(std::span<const std::uint8_t> data, std::int64_t now_ns) {
  if (hangs) return false;
  board_.receive(data, now_ns);
  return true;
}

// a transfer ends with a partial packet, or when it is full
std::optional<Bytes> FtdiChip::in(std::size_t room, std::int64_t now_ns) {
  if (hangs || (to_host_.empty() && now_ns < deadline_ns_)) return std::nullopt;
  Bytes bytes;
  std::size_t size = falcon::kUsbPacketBytes;
  while (size == falcon::kUsbPacketBytes && bytes.size() + size <= room) {
    bytes.insert(bytes.end(), {0x01, 0x60});  // like an FT232 without inputs
    for (size = falcon::kModemBytes; size < falcon::kUsbPacketBytes && !to_host_.empty(); ++size) {
      bytes.push_back(to_host_.front());
      to_host_.pop_front();
    }
  }
  deadline_ns_ = now_ns + 1'000'000 * static_cast<std::int64_t>(board_.settings().latency_ms);
  return bytes;
}

}  // namespace needlelab::test

#include "tests/support/falcon_emulator/ftdi_chip.h"

#include <algorithm>

namespace needlelab::test {
namespace {

// requests of the chip
enum Request : std::uint8_t {
  kReset = 0,
  kModemControl = 1,
  kFlowControl = 2,
  kBaudRate = 3,
  kData = 4,
  kModemStatus = 5,
  kEventChar = 6,
  kErrorChar = 7,
  kSetLatency = 9,
  kGetLatency = 10,
};
constexpr std::size_t kPacket = 64, kDataInPacket = 62;
constexpr std::size_t kBuffer = 256;      // of the chip, towards the host
constexpr std::uint8_t kModem = 0x01;     // as an FT232 shows with nothing on its inputs
constexpr std::uint8_t kLineIdle = 0x60;  // transmitter empty
constexpr std::uint8_t kLineOverrun = 0x02;

}  // namespace

double baudOf(std::uint16_t value, std::uint16_t index) {
  static constexpr double eighths[8] = {0, 0.5, 0.25, 0.125, 0.375, 0.625, 0.75, 0.875};
  const unsigned whole = value & 0x3FFFu;
  const unsigned code = static_cast<unsigned>(value >> 14) | (index & 1u) << 2;
  if (whole == 0) return 3e6;
  if (whole == 1) return code == 0 ? 2e6 : 0;  // 1 plus a fraction is not available
  return 3e6 / (whole + eighths[code]);
}

void FtdiChip::reset() {
  settings_ = {};
  to_host_.clear();
  overrun_flag_ = false;
}

std::optional<Bytes> FtdiChip::control(const UsbSetup& setup, TimePoint) {
  switch (setup.request) {
    case kReset:
      // 0: the chip's serial side; 1 and 2: its buffers, named as the chip sees them
      if (setup.value == 0) {
        to_host_.clear();
        settings_.purged_input = settings_.purged_output = true;
      } else if (setup.value == 1) {
        to_host_.clear();
        settings_.purged_input = true;
      } else if (setup.value == 2) {
        settings_.purged_output = true;
      } else {
        return std::nullopt;
      }
      return Bytes{};
    case kModemControl: {
      const bool dtr_before = settings_.dtr;
      if ((setup.value & 0x0100u) != 0) settings_.dtr = (setup.value & 0x01u) != 0;
      if ((setup.value & 0x0200u) != 0) {
        settings_.rts = (setup.value & 0x02u) != 0;
        settings_.rts_was_set = true;
      }
      peer_.lines(settings_, settings_.dtr && !dtr_before);
      return Bytes{};
    }
    case kFlowControl:
      settings_.flow_control_off = (setup.index >> 8) == 0;
      return Bytes{};
    case kBaudRate:
      settings_.baud = baudOf(setup.value, setup.index);
      return Bytes{};
    case kData:
      settings_.data_bits = setup.value & 0xFFu;
      settings_.parity = (setup.value >> 8) & 7u;
      settings_.stop_bits = (setup.value >> 11) & 3u;
      return Bytes{};
    case kModemStatus:
      return Bytes{kModem, kLineIdle};
    case kEventChar:
    case kErrorChar:
      return Bytes{};
    case kSetLatency:
      if (setup.value < 1 || setup.value > 255) return std::nullopt;
      settings_.latency_ms = setup.value;
      return Bytes{};
    case kGetLatency:
      return Bytes{static_cast<std::uint8_t>(settings_.latency_ms)};
    default:
      return std::nullopt;
  }
}

// start bit, eight bits, stop bit
Clock::duration FtdiChip::byteTime() const {
  if (settings_.baud <= 0) return {};
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(10 / settings_.baud));
}

bool FtdiChip::out(std::span<const std::uint8_t> data, TimePoint now) {
  if (trouble_.nak_out) return false;
  // the chip takes the whole transfer and sends it byte after byte
  sent_until_ = std::max(sent_until_, now);
  for (const std::uint8_t byte : data) {
    sent_until_ += byteTime();
    peer_.receive(byte, settings_, sent_until_);
  }
  return true;
}

void FtdiChip::send(std::uint8_t byte, TimePoint at) {
  ++bytes_from_peer_;
  if (trouble_.drop_every != 0 && bytes_from_peer_ % trouble_.drop_every == 0) return;
  answered_until_ = std::max(answered_until_, at + trouble_.delay) + byteTime();
  if (to_host_.size() >= kBuffer) {
    ++overrun_;
    overrun_flag_ = true;
    return;
  }
  to_host_.push_back({answered_until_, byte});
}

std::size_t FtdiChip::perPacket() const {
  return trouble_.short_packets == 0 ? kDataInPacket : std::min(trouble_.short_packets, kDataInPacket);
}

std::size_t FtdiChip::arrived(TimePoint now) const {
  const auto later =
      std::find_if(to_host_.begin(), to_host_.end(), [now](const Pending& one) { return one.at > now; });
  return static_cast<std::size_t>(later - to_host_.begin());
}

// a transfer ends with a partial packet, or when it is full itself; the chip sends a partial packet when the
// latency timer fires, with or without data
std::optional<Bytes> FtdiChip::in(std::size_t room, TimePoint now) {
  if (trouble_.nak_in || room < 2) return std::nullopt;
  const std::size_t per_packet = perPacket();
  const std::size_t packets_of_room = std::max<std::size_t>(1, room / kPacket);
  const std::size_t there = arrived(now);
  const bool fired = now >= deadline_;
  const bool full = per_packet == kDataInPacket && there / kDataInPacket >= packets_of_room;
  if (!full && !fired) return std::nullopt;

  // a host buffer smaller than a packet gets only the part that fits
  const std::size_t fits = std::min(per_packet, std::min(room, kPacket) - 2);
  Bytes bytes;
  for (std::size_t packet = 0; packet < packets_of_room; ++packet) {
    const std::size_t size = std::min(fits, there - (bytes.size() - 2 * packet));
    bytes.push_back(kModem);
    bytes.push_back(static_cast<std::uint8_t>(kLineIdle | (overrun_flag_ ? kLineOverrun : 0)));
    overrun_flag_ = false;
    for (std::size_t i = 0; i < size; ++i) {
      bytes.push_back(to_host_.front().byte);
      to_host_.pop_front();
    }
    if (size < kDataInPacket) break;
  }
  // the timer keeps its phase, unless the host was away
  if (fired) deadline_ = now - deadline_ < latency() ? deadline_ + latency() : now + latency();
  return bytes;
}

TimePoint FtdiChip::nextEvent(std::size_t room, TimePoint now) const {
  if (room == 0 || trouble_.nak_in) return TimePoint::max();  // `wake` is called when the trouble ends
  TimePoint next = std::max(deadline_, now);
  const std::size_t enough = kDataInPacket * std::max<std::size_t>(1, room / kPacket);
  if (perPacket() == kDataInPacket && to_host_.size() >= enough)
    next = std::min(next, to_host_[enough - 1].at);
  return next;
}

}  // namespace needlelab::test

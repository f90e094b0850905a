#include "tests/support/falcon_emulator/falcon_board.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

namespace needlelab::test {
namespace {

constexpr std::size_t kBoardPacket = 16;
constexpr std::uint8_t kNothing = 0x41;  // the letter that stands for 0
constexpr std::int64_t kTorn_ns = 500'000;

// a serial line tolerates a difference of about 3 %; the chip's nearest rate to 1456312 is 3 % off
bool baudIs(const SerialSettings& settings, double wanted) {
  return std::abs(settings.baud / wanted - 1) < 0.032;
}

std::string baudText(const SerialSettings& settings, const char* wanted) {
  return "baud rate " + std::to_string(settings.baud) + ", not " + wanted;
}

// why a bootloader waiting for its first word does not understand a byte sent with `settings`
std::string wrongForHello(const SerialSettings& settings) {
  if (!settings.purged_input || !settings.purged_output) return "the chip's buffers were not purged";
  if (settings.latency_ms != 16) return "latency " + std::to_string(settings.latency_ms) + " ms, not 16";
  if (!baudIs(settings, 9600)) return baudText(settings, "9600");
  if (settings.data != 8) return "not 8N1";
  if (!settings.flow_control_off) return "flow control was not switched off";
  if (!settings.dtr) return "DTR is not high";
  return {};
}

}  // namespace

double baudOf(std::uint16_t value, std::uint16_t index) {
  static constexpr double eighths[8] = {0, 0.5, 0.25, 0.125, 0.375, 0.625, 0.75, 0.875};
  const unsigned whole = value & 0x3FFFu;
  const unsigned code = static_cast<unsigned>(value >> 14) | (index & 1u) << 2;
  return whole == 0 ? 3e6 : 3e6 / (whole + eighths[code]);
}

bool FalconBoard::request(std::uint8_t request, std::uint16_t value, std::uint16_t index) {
  requests.push_back({request, value, index});
  const bool dtr_before = settings_.dtr;
  switch (request) {
    case 0:  // the chip's buffers, named from the chip's point of view
      if (value == 1) settings_.purged_input = true;
      if (value == 2) settings_.purged_output = true;
      return value <= 2;
    case 1:
      if ((value & 0x0100u) != 0) settings_.dtr = (value & 0x01u) != 0;
      if ((value & 0x0200u) != 0) settings_.rts = (value & 0x02u) != 0;
      // a rising DTR with RTS low resets the board into its bootloader
      if (settings_.dtr && !dtr_before && !settings_.rts) {
        mode = Mode::kWaitsForHello;
        word_.clear();
        if (on_reset) on_reset();
      }
      return true;
    case 2:
      settings_.flow_control_off = (index >> 8) == 0;
      return true;
    case 3:
      settings_.baud = baudOf(value, index);
      return true;
    case 4:
      settings_.data = value;
      return true;
    case 9:
      settings_.latency_ms = value;
      return value >= 1 && value <= 255;
    default:
      return false;
  }
}

void FalconBoard::ignore(std::string why) {
  silent_because = std::move(why);
  word_.clear();
}

void FalconBoard::sayAll(std::span<const std::uint8_t> bytes, std::int64_t at_ns) {
  for (const std::uint8_t byte : bytes) say(byte, at_ns);
}

void FalconBoard::receive(std::span<const std::uint8_t> bytes, std::int64_t now_ns) {
  if (silent) return;
  for (const std::uint8_t byte : bytes) receive(byte, now_ns);
}

void FalconBoard::receive(std::uint8_t byte, std::int64_t now_ns) {
  switch (mode) {
    case Mode::kWaitsForReset:
      return ignore("a byte before DTR rose with RTS low");
    case Mode::kWaitsForHello:
    case Mode::kWaitsForGo:
      return hear(byte, now_ns);
    case Mode::kLoads:
      if (baudIs(settings_, 140'000)) return load(byte, now_ns);
      if (!baudIs(settings_, 1'456'312)) return ignore("firmware neither at 140000 baud nor ended");
      // the host signals that the image is complete
      if (loaded.empty() || (!firmware.empty() && loaded != firmware))
        return ignore("the image of " + std::to_string(loaded.size()) +
                      " bytes is not this device's firmware");
      mode = Mode::kRuns;
      [[fallthrough]];
    case Mode::kRuns:
      if (!baudIs(settings_, 1'456'312)) return ignore(baudText(settings_, "1456312"));
      if (settings_.data != 8) return ignore("not 8N1");
      return command(byte, now_ns);
  }
}

void FalconBoard::hear(std::uint8_t byte, std::int64_t now_ns) {
  if (mode == Mode::kWaitsForHello) {
    if (std::string why = wrongForHello(settings_); !why.empty()) return ignore(std::move(why));
    static constexpr std::array<std::uint8_t, 3> kHello{0x0A, 0x43, 0x0D};
    word_.push_back(byte);
    if (!std::equal(word_.begin(), word_.end(), kHello.begin()))
      return ignore("not the bootloader's first word");
    if (word_.size() < kHello.size()) return;
    word_.clear();
    mode = Mode::kWaitsForGo;
    return sayAll(Bytes{0x0A, 0x44, 0x2C, 0x0D}, now_ns);
  }
  if (settings_.dtr) return ignore("DTR is still high");
  if (!baudIs(settings_, 140'000)) return ignore(baudText(settings_, "140000"));
  if (byte != 0x41) return ignore("not the bootloader's second word");
  mode = Mode::kLoads;
  ++loads;
  loaded.clear();
  say(byte, now_ns);
}

void FalconBoard::load(std::uint8_t byte, std::int64_t now_ns) {
  const std::size_t place = loaded.size();
  loaded.push_back(byte);
  if (on_loaded_byte) on_loaded_byte(place);
  if (echo_missing && place >= *echo_missing) return;
  say(static_cast<std::uint8_t>(echo_wrong == place ? byte ^ 0x10u : byte), now_ns);
}

void FalconBoard::command(std::uint8_t byte, std::int64_t now_ns) {
  if (word_.empty() && byte != '<') return ignore("a byte outside a packet");
  if (byte == '<' && !word_.empty()) ignore("a packet that was cut off");
  word_.push_back(byte);
  if (word_.size() < kBoardPacket) {
    if (word_.size() > 1 && (byte < kNothing || byte > kNothing + 15)) ignore("a byte that no packet has");
    return;
  }
  if (byte != '>') return ignore("a packet without end");
  obey(now_ns);
  word_.clear();
}

void FalconBoard::obey(std::int64_t now_ns) {
  falcon::Command seen;
  for (std::size_t motor = 0; motor < 3; ++motor) {
    int value = 0;
    for (std::size_t nibble = 4; nibble-- > 0;)
      value = value * 16 + (word_[1 + 4 * motor + nibble] - kNothing);
    seen.motor[motor] = static_cast<std::int16_t>(value >= 0x8000 ? value - 0x10000 : value);
  }
  seen.bits = static_cast<std::uint8_t>(word_[13] - kNothing);
  const Fate fate_of_it = fate ? fate() : Fate{};
  if (!fate_of_it.arrives) return;
  if (keeps_commands) heard.push_back({seen, now_ns});
  if (on_command) on_command(seen, now_ns);
  if (!fate_of_it.is_answered) return;

  Bytes packet{'<'};
  for (const std::int16_t count : encoder)
    for (const unsigned shift : {0u, 4u, 8u, 12u})
      packet.push_back(
          static_cast<std::uint8_t>(kNothing + (static_cast<std::uint16_t>(count) >> shift) % 16u));
  packet.push_back(static_cast<std::uint8_t>(kNothing + (homed | buttons)));
  packet.push_back(kNothing);
  packet.push_back('>');
  if (garbage || fate_of_it.is_garbled) packet[4] = '?';
  const std::int64_t at_ns = now_ns + fate_of_it.reply_ns;
  const std::size_t first = fate_of_it.is_torn ? kBoardPacket / 2 : kBoardPacket;
  sayAll(std::span(packet).first(first), at_ns);
  sayAll(std::span(packet).subspan(first), at_ns + kTorn_ns);
}

}  // namespace needlelab::test

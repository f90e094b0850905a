#include "tests/support/falcon_emulator/falcon_board.h"

#include <cmath>
#include <utility>

namespace needlelab::test {
namespace {

constexpr std::size_t kBoardPacket = 16, kHistory = 20'000;
constexpr std::uint8_t kNothing = 0x41;  // the letter that stands for 0

// a serial line tolerates a difference of about 3 %; the chip's nearest rate to 1456312 is 3 % off
bool baudIs(const SerialSettings& settings, double wanted) {
  return std::abs(settings.baud / wanted - 1) < 0.032;
}

// why a bootloader waiting for its first word does not understand a byte sent with `settings`
std::string wrongForHello(const SerialSettings& settings) {
  if (!settings.purged_input || !settings.purged_output) return "the chip's buffers were not purged";
  if (settings.latency_ms != 16) return "latency " + std::to_string(settings.latency_ms) + " ms, not 16";
  if (!baudIs(settings, 9600)) return "baud rate " + std::to_string(settings.baud) + ", not 9600";
  if (settings.data_bits != 8 || settings.parity != 0 || settings.stop_bits != 0) return "not 8N1";
  if (!settings.flow_control_off) return "flow control was not switched off";
  if (!settings.rts_was_set || settings.rts) return "RTS is not low";
  if (!settings.dtr) return "DTR is not high";
  return {};
}

}  // namespace

void FalconBoard::powerOn(bool running) {
  mode_ = running ? Mode::kRuns : Mode::kWaitsForReset;
  heard_.clear();
  image_.clear();
  lights_ = 0;
  body_.drive({});
  body_.lookForZero(false);
  body_.resetEncoders();
}

void FalconBoard::ignore(std::string why) {
  silent_because_ = std::move(why);
  ++bad_bytes_;
  heard_.clear();
}

void FalconBoard::say(std::initializer_list<std::uint8_t> bytes, TimePoint at) {
  if (trouble.deaf) return;
  for (const std::uint8_t byte : bytes) chip_->send(byte, at);
}

// a rising DTR resets the board into its bootloader
void FalconBoard::lines(const SerialSettings& settings, bool dtr_rose) {
  if (!dtr_rose) return;
  if (!settings.rts_was_set || settings.rts) return;
  powerOn(false);
  mode_ = Mode::kWaitsForHello;
}

void FalconBoard::receive(std::uint8_t byte, const SerialSettings& settings, TimePoint at) {
  switch (mode_) {
    case Mode::kWaitsForReset:
      return ignore("a byte before DTR rose with RTS low");
    case Mode::kWaitsForHello:
    case Mode::kWaitsForGo:
      return hear(byte, settings, at);
    case Mode::kLoads:
      if (baudIs(settings, 140'000)) return load(byte, at);
      if (!baudIs(settings, 1'456'312)) return ignore("firmware neither at 140000 baud nor ended");
      // the host reports that the image is complete
      if (image_.empty() || (!firmware_.empty() && image_ != firmware_))
        return ignore("the image of " + std::to_string(image_.size()) +
                      " bytes is not this device's firmware");
      mode_ = Mode::kRuns;
      [[fallthrough]];
    case Mode::kRuns:
      if (!baudIs(settings, 1'456'312))
        return ignore("baud rate " + std::to_string(settings.baud) + ", not 1456312");
      if (settings.data_bits != 8 || settings.parity != 0 || settings.stop_bits != 0)
        return ignore("not 8N1");
      return command(byte, at);
  }
}

void FalconBoard::hear(std::uint8_t byte, const SerialSettings& settings, TimePoint at) {
  if (mode_ == Mode::kWaitsForHello) {
    if (std::string why = wrongForHello(settings); !why.empty()) return ignore(std::move(why));
    static const Bytes word{0x0A, 0x43, 0x0D};
    heard_.push_back(byte);
    if (!std::equal(heard_.begin(), heard_.end(), word.begin()))
      return ignore("not the bootloader's first word");
    if (heard_.size() < word.size()) return;
    heard_.clear();
    mode_ = Mode::kWaitsForGo;
    return say({0x0A, 0x44, 0x2C, 0x0D}, at);
  }
  if (settings.dtr) return ignore("DTR is still high");
  if (!baudIs(settings, 140'000))
    return ignore("baud rate " + std::to_string(settings.baud) + ", not 140000");
  if (byte != 0x41) return ignore("not the bootloader's second word");
  mode_ = Mode::kLoads;
  say({0x41}, at);
}

void FalconBoard::load(std::uint8_t byte, TimePoint at) {
  const std::size_t place = image_.size();
  image_.push_back(byte);
  if (place >= trouble.echo_stops_at) return;
  say({static_cast<std::uint8_t>(place == trouble.echo_wrong_at ? byte ^ 0x10u : byte)}, at);
}

void FalconBoard::command(std::uint8_t byte, TimePoint at) {
  if (heard_.empty() && byte != '<') return ignore("a byte outside a packet");
  if (byte == '<' && !heard_.empty()) ignore("a packet that was cut off");
  heard_.push_back(byte);
  if (heard_.size() < kBoardPacket) {
    if (heard_.size() > 1 && (byte < kNothing || byte > kNothing + 15)) ignore("a byte that no packet has");
    return;
  }
  if (byte != '>') return ignore("a packet without end");
  obey(at);
  heard_.clear();
  if (!trouble.stall) reply(at);
}

void FalconBoard::obey(TimePoint at) {
  CommandSeen seen;
  seen.at = at;
  for (std::size_t motor = 0; motor < 3; ++motor) {
    int value = 0;
    for (int nibble = 3; nibble >= 0; --nibble)
      value = value * 16 + (heard_[1 + 4 * motor + static_cast<std::size_t>(nibble)] - kNothing);
    seen.motors[motor] = static_cast<std::int16_t>(value >= 0x8000 ? value - 0x10000 : value);
  }
  seen.bits = static_cast<unsigned>(heard_[13] - kNothing);
  ++commands_;
  history_.push_back(seen);
  if (history_.size() > kHistory) history_.pop_front();
  body_.advance(at);
  body_.drive(seen.motors);
  body_.lookForZero((seen.bits & 1u) != 0);
  lights_ = seen.bits & 0xEu;
}

void FalconBoard::reply(TimePoint at) {
  if (trouble.deaf) return;
  Bytes packet{'<'};
  for (const std::int16_t count : body_.encoders()) {
    const unsigned raw = static_cast<std::uint16_t>(count);
    for (unsigned nibble = 0; nibble < 4; ++nibble)
      packet.push_back(static_cast<std::uint8_t>(kNothing + (raw / (1u << (4 * nibble))) % 16));
  }
  packet.push_back(static_cast<std::uint8_t>(kNothing + ((buttons & 0xFu) | (body_.homed() & 7u) << 4)));
  packet.push_back(kNothing);
  packet.push_back('>');

  const auto chance = [this](double share) {
    return std::uniform_real_distribution<>(0, 1)(random_) < share;
  };
  const auto any = [this](std::size_t below) { return static_cast<std::size_t>(random_() % below); };
  if (chance(trouble.garbage_share)) {
    Bytes noise(1 + any(20));
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random_());
    packet.insert(packet.begin(), noise.begin(), noise.end());
  }
  if (chance(trouble.flip_share)) packet[any(packet.size())] ^= static_cast<std::uint8_t>(1 + any(255));
  if (chance(trouble.cut_share)) packet.resize(1 + any(packet.size() - 1));
  for (const std::uint8_t byte : packet) chip_->send(byte, at);
}

}  // namespace needlelab::test

#include "tests/support/falcon_emulator/falcon_emulator.h"

#include <utility>

#include "client/device/falcon/falcon_geometry.h"

namespace needlelab::test {

FalconEmulator::FalconEmulator(UsbTestbed& testbed, const std::string& serial)
    : port_(testbed, chip_, serial) {
  grip_.is_soft = false;
  board_.on_reset = [this] {
    // the encoders count from the arms' current position
    board_.homed = 0;
    zero_ = grip_.encoders();
    grip_.motors = {};
  };
  board_.on_command = [this](const falcon::Command& command, std::int64_t) { obey(command); };
  board_.on_reset();
}

// an encoder that searches for its zero finds it when the thigh passes the mark
void FalconEmulator::obey(const falcon::Command& command) {
  const Motors before = grip_.encoders();
  grip_.advance(grip_.at_ns + 1'000'000);
  grip_.motors = command.motor;
  const Motors now = grip_.encoders();
  for (std::size_t leg = 0; leg < 3; ++leg) {
    const bool passes = (before[leg] > 0) != (now[leg] > 0);
    if ((command.bits & falcon::kOutHome) != 0 && passes) {
      board_.homed = static_cast<std::uint8_t>(board_.homed | 0x10u << leg);
      zero_[leg] = 0;
    }
    board_.encoder[leg] = static_cast<std::int16_t>(now[leg] - zero_[leg]);
  }
}

void FalconEmulator::hold(HandPath path) {
  with([&path](FalconBoard&, FtdiChip&, FalconGrip& grip) {
    grip.is_soft = false;
    grip.follow(std::move(path));
  });
}

Vec3 FalconEmulator::force_N() {
  return with([](FalconBoard&, FtdiChip&, FalconGrip& grip) { return grip.force_N(); });
}

bool FalconEmulator::isHomed() {
  return with([](FalconBoard& board, FtdiChip&, FalconGrip&) { return board.homed == falcon::kInHomed; });
}

std::vector<Heard> FalconEmulator::heard() {
  return with([](FalconBoard& board, FtdiChip&, FalconGrip&) { return board.heard; });
}

}  // namespace needlelab::test

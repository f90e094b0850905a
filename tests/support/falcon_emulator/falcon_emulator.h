/// A Novint Falcon on an emulated USB, held by a hand. The hand moves by a millisecond with each command: a
/// host that stalls finds the grip where it was.
#pragma once

#include <string>
#include <vector>

#include "tests/support/falcon_emulator/falcon_board.h"
#include "tests/support/falcon_emulator/falcon_grip.h"
#include "tests/support/falcon_emulator/ftdi_chip.h"
#include "tests/support/falcon_emulator/usb_port.h"

namespace needlelab::test {

/// Call it from the test's thread only.
class FalconEmulator {
 public:
  explicit FalconEmulator(UsbTestbed& testbed, const std::string& serial = "FALCON01");
  ~FalconEmulator() { port_.unplug(); }
  FalconEmulator(const FalconEmulator&) = delete;
  FalconEmulator& operator=(const FalconEmulator&) = delete;

  UsbPort& port() { return port_; }
  void plug() { port_.plug(); }
  void unplug() { port_.unplug(); }

  /// Changes or reads the state of the board, the chip and the grip.
  template <typename Use>
  auto with(Use&& use) {
    struct Wake {
      UsbPort& port;
      ~Wake() { port.wake(); }
    } const wake{port_};
    const std::scoped_lock lock(board_.mutex);
    return use(board_, chip_, grip_);
  }
  /// The hand holds the grip and does not yield.
  void hold(HandPath path);
  void holdAt(Vec3 p_W_m) {
    hold([p_W_m](double) { return p_W_m; });
  }
  /// The motors move the hand from now on.
  void letGive() {
    with([](FalconBoard&, FtdiChip&, FalconGrip& grip) { grip.is_soft = true; });
  }
  /// Makes all transfers hang, or stops that.
  void hang(bool hangs) {
    with([hangs](FalconBoard&, FtdiChip& chip, FalconGrip&) { chip.hangs = hangs; });
  }

  [[nodiscard]] Vec3 force_N();  ///< of the motors on the hand, in W
  [[nodiscard]] bool isHomed();
  [[nodiscard]] std::vector<Heard> heard();  ///< all commands

 private:
  void obey(const falcon::Command& command);

  FalconBoard board_;
  FalconGrip grip_;
  std::array<std::int16_t, 3> zero_{};  // the encoders' offset, in counts of homed ones
  FtdiChip chip_{board_};
  UsbPort port_;
};

}  // namespace needlelab::test

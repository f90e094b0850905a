/// A Novint Falcon on an emulated USB, with a hand on it. The tests of the device `falcon` run against it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/support/falcon_emulator/falcon_board.h"
#include "tests/support/falcon_emulator/usb_port.h"

namespace needlelab::test {

struct EmulatedFalconOptions {
  std::string serial = "FALCON01";
  Bytes firmware;                ///< the only image that its bootloader starts; empty: any
  bool firmware_running = true;  ///< from the start; false: it waits in its bootloader
};

/// Call it from the test's thread only. `with` gives access to all other state, under the lock.
class FalconEmulator {
 public:
  explicit FalconEmulator(UsbTestbed& testbed, EmulatedFalconOptions options = {});
  ~FalconEmulator() { port_.unplug(); }

  UsbPort& port() { return port_; }
  void plug() { port_.plug(); }
  void unplug() { port_.unplug(); }
  /// Also cuts the device's power: it forgets its state, and its encoders count from zero again. Only for an
  /// unplugged device.
  void powerCycle(bool firmware_running = false);

  /// Changes or reads the board's, the chip's and the body's state.
  template <typename Use>
  auto with(Use&& use) {
    struct Wake {
      UsbPort& port;
      ~Wake() { port.wake(); }
    } const wake{port_};
    const std::lock_guard lock(port_.mutex());
    body_.advance(Clock::now());
    return use(board_, chip_, body_);
  }

  /// In F; the hand follows the new path from now on.
  void holdRigidly(HandPath path);
  void holdAt(const Eigen::Vector3d& p_F_m);
  void holdSoftly(const SoftHand& hand, HandPath path);
  void setButtons(unsigned buttons);
  void setBoardTrouble(const BoardTrouble& trouble);
  void setLineTrouble(const LineTrouble& trouble);

  [[nodiscard]] Eigen::Vector3d grip();   ///< in F, now
  [[nodiscard]] Eigen::Vector3d force();  ///< of the motors on the hand, in F, now
  [[nodiscard]] unsigned lights();
  [[nodiscard]] unsigned homed();
  [[nodiscard]] std::uint64_t commands();
  [[nodiscard]] std::vector<CommandSeen> history();
  [[nodiscard]] FalconBoard::Mode mode();
  [[nodiscard]] std::string silentBecause();

 private:
  FalconBody body_;
  FalconBoard board_;
  FtdiChip chip_;
  UsbPort port_;
};

}  // namespace needlelab::test

/// The syringe's plunger, from a device's readings; and the `--plunger` option.
#pragma once

#include <cstdint>
#include <string>

#include "client/device/device.h"
#include "common/base/result.h"

namespace needlelab {

/// How readings become a plunger. Buttons are numbers of bits in `DeviceReading::buttons`.
struct PlungerSettings {
  PlungerSource source = PlungerSource::kAnalog;  ///< of the device
  int push_button = 0;                            ///< pressed: the plunger goes down; 0-31
  int pull_button = 1;                            ///< pressed: it is drawn back; -1: there is no such button
  double stroke_s = 3;                            ///< the whole way, with a button
  double start = 0.2;  ///< with buttons: not drawn out at first, so that one can aspirate
};

/// The plunger, 0 (drawn out) to 1 (pressed down). Measured: as the device reports, clamped to 0-1; a value
/// that is not a number leaves it where it was. Buttons: it moves by 1/`stroke_s` a second while one of the
/// two is pressed, in the ticks that were missed too, but no longer than 100 ms on one reading; both or none:
/// it stays. Neither: 0. Thread: the haptic thread only. Real-time safe; same readings, same bits.
class Plunger {
 public:
  Plunger(const PlungerSettings& settings, double rate_hz) noexcept;

  /// One tick; `fresh`: the device gave a reading, `elapsed_ticks` since the last call. A reading that is not
  /// fresh moves nothing: a device that is lost does not go on injecting.
  double update(const DeviceReading& reading, bool fresh, std::int64_t elapsed_ticks) noexcept;
  [[nodiscard]] double position() const noexcept { return position_; }

 private:
  PlungerSettings settings_;
  double per_tick_;
  std::int64_t most_ticks_;
  std::int64_t waiting_ticks_ = 0;  // since the last fresh reading
  double position_;
};

/// `PUSH[,PULL]`: the numbers (0-31) of the button that presses the plunger and of the one that draws it
/// back; without the second the plunger cannot be drawn back. Errors: kInvalidInput, with the value found and
/// the allowed ones.
Status parsePlungerOption(const std::string& text, PlungerSettings& settings);

}  // namespace needlelab

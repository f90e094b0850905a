/// Computes the syringe's plunger position from a device's readings; parses the `--plunger` option.
#pragma once

#include <cstdint>
#include <string>

#include "client/device/device.h"
#include "common/base/result.h"

namespace needlelab {

/// How readings move the plunger. Buttons are numbers of bits in `DeviceReading::buttons`.
struct PlungerSettings {
  PlungerSource source = PlungerSource::kAnalog;  ///< of the device
  int push_button = 0;                            ///< pressed: the plunger goes down; 0-31
  int pull_button = 1;                            ///< pressed: the plunger is drawn back; -1: no such button
  double stroke_s = 3;                            ///< time of the full stroke, with a button
  double start = 0.2;  ///< start position with buttons: above 0, so that the trainee can aspirate
};

/// The plunger, 0 (drawn out) to 1 (pressed down). Measured: the device's value clamped to 0-1; a NaN changes
/// nothing. Buttons: the plunger moves at 1/`stroke_s` per second while one of the two is pressed, including
/// missed ticks, but at most 100 ms on one reading; with both or neither pressed it stays. No source: 0.
/// Thread: the haptic thread only. Real-time safe; same readings, same bits.
class Plunger {
 public:
  Plunger(const PlungerSettings& settings, double rate_hz) noexcept;

  /// One tick; `fresh`: the device gave a reading, `elapsed_ticks` since the last call. Only a fresh reading
  /// moves the plunger, so that a lost device does not continue an injection.
  double update(const DeviceReading& reading, bool fresh, std::int64_t elapsed_ticks) noexcept;
  [[nodiscard]] double position() const noexcept { return position_; }

 private:
  PlungerSettings settings_;
  double per_tick_;
  std::int64_t max_ticks_;
  std::int64_t waiting_ticks_ = 0;  // since the last fresh reading
  double position_;
};

/// `PUSH[,PULL]`: the numbers (0-31) of the button that presses the plunger and of the one that draws it
/// back; without PULL the plunger cannot be drawn back. Errors: kInvalidInput, with the found and the allowed
/// values.
Status parsePlungerOption(const std::string& text, PlungerSettings& settings);

}  // namespace needlelab

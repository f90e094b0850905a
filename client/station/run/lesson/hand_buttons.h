/// The trainee's raised hand, by the handle's buttons.
#pragma once

#include <cstdint>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab {

/// These buttons, held together for a second, raise the trainee's hand, or lower it. Where they move the
/// plunger, together they hold it still.
inline constexpr std::uint32_t kHandButtons = 0b11;
inline constexpr double kHandButtonsHeld_s = 1;

/// Thread: one.
class HandButtons {
 public:
  explicit HandButtons(double rate_hz) : rate_hz_(rate_hz) {}
  /// Returns whether a press became long enough within these samples, which ascend by tick.
  bool press(const std::vector<GestureSample>& samples) {
    bool now = false;
    for (const GestureSample& sample : samples) {
      if ((sample.buttons & kHandButtons) != kHandButtons) {
        pressed_ = counted_ = false;
        continue;
      }
      if (!pressed_) since_ = sample.tick;
      pressed_ = true;
      if (counted_ || static_cast<double>(sample.tick - since_) < kHandButtonsHeld_s * rate_hz_) continue;
      counted_ = now = true;
    }
    return now;
  }

 private:
  double rate_hz_;
  bool pressed_ = false, counted_ = false;
  std::uint64_t since_ = 0;
};

}  // namespace needlelab

/// Defines when a contact begins, of the tip with bone or of the hub with the skin; used by measures, the
/// station's warnings, and marks in plots and reports.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "common/haptics/engine.h"

namespace needlelab {

/// Minimum time without touch before another contact can begin, so that tremor (8-12 Hz) at a surface is one
/// contact. A longer time would merge two touches of a hand that feels its way.
inline constexpr double kContactAway_s = 0.2;

/// Counts the contacts between two things, moment by moment. Thread: one.
class Contacts {
 public:
  /// Adds the next moment; times must ascend. Returns whether a contact begins. Assumes nothing about the
  /// time between two moments.
  bool add(double time_s, bool touching) {
    if (!touching) {
      if (in_contact_ && !away_since_s_) away_since_s_ = time_s;
      return false;
    }
    // slightly less, so that rounding of a time does not decide
    const bool begins =
        !in_contact_ || (away_since_s_ && time_s - *away_since_s_ >= kContactAway_s * (1 - 1e-9));
    in_contact_ = true;
    away_since_s_.reset();
    return begins;
  }

 private:
  bool in_contact_ = false;
  std::optional<double> away_since_s_;  // during a contact: when the last touch ended
};

/// The event's display name.
inline constexpr std::string_view kHubContactWords = "hub on the skin";

/// Contacts of the needle's hub with the skin: the inserted length exceeds the needle's length. Thread: one.
class HubContacts {
 public:
  /// Adds the next tick, like Contacts::add(). `flags`: a sample's; thinned recordings have them, too. A tick
  /// that was not stepped does not tell where the hub is.
  bool add(double time_s, std::uint32_t flags) {
    const bool touching = (flags & kFlagBeyondNeedle) != 0;
    return (touching || (flags & kFlagNotStepped) == 0) && contacts_.add(time_s, touching);
  }

 private:
  Contacts contacts_;
};

}  // namespace needlelab

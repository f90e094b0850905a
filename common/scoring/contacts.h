/// When a contact begins, of the tip with bone or of the hub with the skin: a rule for the measures, the
/// station's warnings, and the marks of plots and reports.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "common/haptics/engine.h"

namespace needlelab {

/// What touches has to be away for this long before it can make another contact: tremor (8-12 Hz) at a
/// surface is one contact. A longer time would join two touches of a hand that feels its way.
inline constexpr double kContactAway_s = 0.2;

/// The contacts of one thing with another, moment by moment. Thread: one.
class Contacts {
 public:
  /// Takes the next moment; times ascend. Returns whether a contact begins in it. Nothing is assumed about
  /// the time between two moments.
  bool add(double time_s, bool touching) {
    if (!touching) {
      if (in_contact_ && !away_since_s_) away_since_s_ = time_s;
      return false;
    }
    // a hair less, so that the last digit of a time does not decide
    const bool begins =
        !in_contact_ || (away_since_s_ && time_s - *away_since_s_ >= kContactAway_s * (1 - 1e-9));
    in_contact_ = true;
    away_since_s_.reset();
    return begins;
  }

 private:
  bool in_contact_ = false;
  std::optional<double> away_since_s_;  // during a contact: since when it is away
};

/// The event's name for people.
inline constexpr std::string_view kHubContactWords = "hub on the skin";

/// Contacts of the needle's hub with the skin: the needle is in for more than its length. Thread: one.
class HubContacts {
 public:
  /// Takes the next tick, as Contacts::add(). `flags`: a sample's; a thinned recording's say it, too. A tick
  /// that was not stepped does not say where the hub is.
  bool add(double time_s, std::uint32_t flags) {
    const bool touching = (flags & kFlagBeyondNeedle) != 0;
    return (touching || (flags & kFlagNotStepped) == 0) && contacts_.add(time_s, touching);
  }

 private:
  Contacts contacts_;
};

}  // namespace needlelab

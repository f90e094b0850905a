/// What is laid over the lesson when there is no force: what happened and what to do, in plain words.
#pragma once

#include <cstdint>
#include <string>

#include "client/station/run/lesson_audience.h"

namespace needlelab {

struct Overlay {
  enum class Kind : std::uint8_t { kNone, kHold, kFault };
  Kind kind = Kind::kNone;
  std::string title;             ///< "The force was taken away"
  std::string what;              ///< why
  std::string todo;              ///< what to do now
  bool can_acknowledge = false;  ///< Enter, or the button, counts now
};

/// Pure.
Overlay overlayOf(const LessonStanding& standing);

}  // namespace needlelab

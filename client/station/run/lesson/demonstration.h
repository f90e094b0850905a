/// A lesson as a simulated expert does it, for a trainee who wants to see it once.
#pragma once

#include <optional>
#include <vector>

#include "client/device/hand/hand_options.h"
#include "client/station/run/lesson/lesson.h"
#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// What a window shows one after the other, as in SamplePiece.
struct Demonstration {
  struct Piece {
    std::vector<GestureSample> samples;  ///< 20 ms of ticks
    Bytes cut_memory, paths;             ///< as in SamplePiece
  };
  std::vector<Piece> pieces;
  double piece_s = 0.02;
  [[nodiscard]] double duration_s() const { return static_cast<double>(pieces.size()) * piece_s; }
};

/// Returns the way of the lesson's needle: on the exercise's planned line, if it has one.
PlannedInsertion insertionOf(const StationLesson& lesson, const Pose& X_WL);

/// Goes in on the planned line to the right depth, aspirates, injects and comes out; `capped`: feels for the
/// landmark first. In virtual time, with the lesson's own model, through the gate; same lesson, same bits.
/// Takes about 0.5 s in a body. Errors: kFailed, if the gate takes the force away. Thread: any but the haptic
/// one.
Result<Demonstration> demonstrationOf(const StationLesson& lesson, const Pose& X_WL, bool capped);

}  // namespace needlelab

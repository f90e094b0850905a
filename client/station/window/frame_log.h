/// What each frame of the trainee's window showed, as CSV (--frame-log): for an observer outside the window
/// that waits for a screen or a frame, and for measurements of latency.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "client/station/window/lessons/lesson_board.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// A question over the screen that can be answered.
enum class ShownQuestion : std::uint8_t { kNone, kEndLesson, kQuit, kBeginExam };

inline constexpr Vec3 kNowhere_m{std::numeric_limits<double>::quiet_NaN(),
                                 std::numeric_limits<double>::quiet_NaN(),
                                 std::numeric_limits<double>::quiet_NaN()};

/// One frame.
struct ShownFrame {
  Stage stage = Stage::kOpening;
  ShownQuestion question = ShownQuestion::kNone;
  bool can_begin = false;    ///< Enter begins a lesson: on the Start and End screens, when they allow it
  std::uint64_t lesson = 0;  ///< as BoardState::lesson
  // the newest sample shown; 0 and not-a-number before the first
  double lesson_s = 0;                                        ///< as Moment::time_s
  double depth_m = std::numeric_limits<double>::quiet_NaN();  ///< as Moment::depth_m
  double plunger = std::numeric_limits<double>::quiet_NaN();  ///< 0-1
  Vec3 p_WT_m = kNowhere_m;                                   ///< the tip
  Vec3 aim_WT_m = kNowhere_m;  ///< where mouse and keys want the tip; not-a-number: no steering
};

/// Thread: the window's.
class FrameLog {
 public:
  /// Creates or replaces the file and writes the column names. Errors: kFailed, with the file and the reason.
  static Result<FrameLog> open(const std::filesystem::path& file);
  /// Writes a line, which others can read at once. `shown_ns`: when the frame was handed to the display, on
  /// the steady clock. Errors: kFailed, with the file and the reason.
  Status add(const ShownFrame& frame, std::int64_t shown_ns);

 private:
  explicit FrameLog(const std::filesystem::path& file);
  Status write(const std::string& line);

  std::filesystem::path file_;
  std::ofstream out_;
  std::uint64_t frames_ = 0;
};

}  // namespace needlelab

/// What each frame of the trainee's window showed, as CSV (--frame-log), and its words (--text-log): for an
/// observer outside the window that waits for a screen, a frame or a word, and for measurements of latency.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

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

/// A file to which lines are added that others can read at once. Thread: the window's.
class LineLog {
 public:
  /// Creates or replaces the file. `option` names it in errors. Errors: kFailed, with the file and the
  /// reason.
  static Result<LineLog> open(std::string_view option, const std::filesystem::path& file);
  /// Errors: as open.
  Status add(std::string line);

 private:
  LineLog(std::string_view option, const std::filesystem::path& file)
      : option_(option), file_(file), out_(file, std::ios::trunc) {}
  [[nodiscard]] Status written() const;

  std::string option_;
  std::filesystem::path file_;
  std::ofstream out_;
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
  explicit FrameLog(LineLog log) : log_(std::move(log)) {}

  LineLog log_;
  std::uint64_t frames_ = 0;
};

/// The words of each frame that has others than the one before, as JSON: {"frame": 7, "words": ["Step 1 of
/// 3", …]}, in the order of drawing. Thread: the window's.
class TextLog {
 public:
  /// Errors: kFailed, with the file and the reason; for `add`, too.
  static Result<TextLog> open(const std::filesystem::path& file);
  Status add(const std::vector<std::string>& words);

 private:
  explicit TextLog(LineLog log) : log_(std::move(log)) {}

  LineLog log_;
  std::uint64_t frames_ = 0;
  std::vector<std::string> last_;
};

}  // namespace needlelab

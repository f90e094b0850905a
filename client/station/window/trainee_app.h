/// needlelab-station with its window.
#pragma once

#include <csignal>
#include <cstddef>
#include <utility>
#include <vector>

#include "client/station/run/options.h"
#include "client/station/window/lesson_board.h"

namespace needlelab {

/// Pure logic. Each picture is taken once.
class PicturePlan {
 public:
  explicit PicturePlan(std::vector<PictureRequest> pictures)
      : pictures_(std::move(pictures)), taken_(pictures_.size(), false) {}

  /// Those that are due at a frame that shows `stage`, `lesson_s` into the lesson. Start and End are due at
  /// the third frame of theirs: by then everything stands where it belongs.
  std::vector<PictureRequest> due(Stage stage, double lesson_s);
  /// All are taken, or cannot be any more.
  [[nodiscard]] bool done() const;
  /// Those that were not taken.
  [[nodiscard]] std::vector<PictureRequest> missing() const;

 private:
  std::vector<PictureRequest> pictures_;
  std::vector<bool> taken_;
  Stage last_ = Stage::kOpening;
  int frames_ = 0;
};

/// Lessons in a window until a person closes it, a stop signal comes or the display goes; without a display,
/// for pictures only, one lesson. `stop_signals`: from blockStopSignals. Gives the program's exit code. The
/// lessons run on a thread of their own: a window that is closed, gone or slow ends or delays no tick; a
/// lesson that runs when it goes is ended as by its stop, stored and sent. Thread: main (GLFW).
int runTrainee(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab

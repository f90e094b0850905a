/// needlelab-station with its window.
#pragma once

#include <csignal>
#include <cstddef>
#include <utility>
#include <vector>

#include "client/station/run/io/options.h"
#include "client/station/window/lessons/lesson_board.h"

namespace needlelab {

/// Decides when to take pictures. Pure logic. Takes each picture once.
class PicturePlan {
 public:
  explicit PicturePlan(std::vector<PictureRequest> pictures)
      : pictures_(std::move(pictures)), taken_(pictures_.size(), false) {}

  /// Returns the pictures due at a frame of `stage`, `lesson_s` into the lesson. Start and End are due at
  /// their third frame, when the layout is final.
  std::vector<PictureRequest> due(Stage stage, double lesson_s);
  /// Returns whether all pictures are taken, or belong to a lesson that had ended at the last frame.
  [[nodiscard]] bool done() const;
  /// Returns the pictures not taken.
  [[nodiscard]] std::vector<PictureRequest> missing() const;

 private:
  std::vector<PictureRequest> pictures_;
  std::vector<bool> taken_;
  Stage last_ = Stage::kOpening;
  int frames_ = 0;
};

/// Runs lessons in a window until a person closes it, a stop signal comes or the display is lost. Without a
/// display it runs one lesson, for pictures only. `stop_signals`: from blockStopSignals. Returns the
/// program's exit code. The lessons run on their own thread, so a closed, lost or slow window does not end or
/// delay a tick. If the window is lost during a lesson, the lesson ends as if stopped, and the recording is
/// stored and sent. Thread: main (GLFW).
int runTrainee(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab

/// Runs lesson after lesson, as a person at the window requests them.
#pragma once

#include <csignal>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/options.h"
#include "client/station/run/station.h"
#include "client/station/run/station_run.h"
#include "client/station/window/lesson_board.h"

namespace needlelab {

/// Thread: made by one; `run` on the thread that shall run the lessons, which is not the window's. Everything
/// else goes by the board, and `requests`.
class LessonSequence {
 public:
  /// All must outlive it. `alone`: nobody is at the window (there is no display). `begins`: the first lesson
  /// begins at once.
  LessonSequence(const StationOptions& options, const sigset_t& stop_signals, LessonBoard& board, bool alone,
                 bool begins);

  /// Until a person quits or a stop signal comes. Gives the program's exit code: 1 when a lesson ended in
  /// FAULT or is not safe, and when nothing could be practised, that error's.
  int run();
  /// For stops and acknowledgements. Thread: any.
  [[nodiscard]] LessonRequests& requests() { return home_.requests(); }
  /// A thread hangs in a device's driver: end the program by std::_Exit.
  [[nodiscard]] bool hangs() const { return hangs_; }

 private:
  bool open();
  void showStart();
  void refreshLists();
  void updateDevice();
  void updateServer();
  void handle(const BoardRequest& request);
  void practise(const LessonChoice& choice);
  void showOutcome();
  void reportLast();
  [[nodiscard]] LessonChoice firstChoice() const;

  const StationOptions& options_;
  const sigset_t& signals_;
  LessonBoard& board_;
  const bool alone_, begins_;
  StationHome home_;
  std::unique_ptr<StationRun> last_;      // not reported yet
  std::optional<LessonOutcome> outcome_;  // its
  std::vector<StationSummary> earlier_;
  std::string lists_made_with_;  // the server's state when the lists were made
  std::int64_t next_device_look_ns_ = 0, next_server_look_ns_ = 0, drain_until_ns_ = 0;
  bool device_ready_ = false;
  std::optional<int> code_;  // worst of the lessons so far
  int failed_to_begin_ = 0;
  bool quit_ = false, hangs_ = false;
};

}  // namespace needlelab

/// Plays a lesson's demonstration in the trainee's window. The lesson itself goes on.
#pragma once

#include <cstddef>
#include <future>
#include <memory>
#include <string>

#include "client/station/run/lesson/demonstration.h"
#include "client/station/window/screens/lesson_follow.h"

namespace needlelab {

/// Thread: the window's; it computes the demonstration on a thread of its own.
class DemonstrationPlayer {
 public:
  /// A new lesson: stops, and forgets the last one's.
  void begin();
  /// Computes the demonstration, if that was not done yet, and plays it from its beginning.
  void play(const LessonFollow& lesson);
  void stop() { wanted_ = false, shown_ = nullptr; }
  [[nodiscard]] bool isOn() const { return wanted_; }
  /// Goes on by a frame. At its end it stops.
  void advance(const LessonFollow& lesson, double dt_s);
  /// What is played; null: nothing, or it is still being computed.
  [[nodiscard]] const LessonFollow* shown() const { return shown_.get(); }
  /// 0-1.
  [[nodiscard]] double progress() const;
  /// Why there is none; empty: no trouble.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  std::future<Result<Demonstration>> coming_;
  std::shared_ptr<const Demonstration> made_;
  std::unique_ptr<LessonFollow> shown_;
  std::string trouble_;
  bool wanted_ = false;
  double time_s_ = 0;
  std::size_t fed_ = 0;  // pieces
};

}  // namespace needlelab

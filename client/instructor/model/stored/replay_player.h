/// The clock of a replay: play, pause, seek, speed, step, loop. Pure: the view passes the elapsed time.
#pragma once

#include <optional>

namespace needlelab {

inline constexpr double kSlowestReplay = 0.1, kFastestReplay = 8;
/// One step back or forward.
inline constexpr double kReplayStep_s = 0.01;

struct ReplayLoop {
  double from_s = 0, to_s = 0;
};

/// All times are gesture times. Thread: one.
class ReplayPlayer {
 public:
  /// Loads a gesture from `first_s` to `last_s`. Starts at its beginning, paused, at speed 1, without a loop.
  void load(double first_s, double last_s);

  void play();  ///< at the end, restarts from the beginning (of the loop, if set)
  void pause() { playing_ = false; }
  void toggle() { playing_ ? pause() : play(); }
  /// Clamped to the gesture.
  void seek(double time_s);
  /// Pauses and moves by `steps`.
  void step(int steps);
  /// Clamped to kSlowestReplay … kFastestReplay; ignores values that are not finite.
  void setSpeed(double speed);
  /// Selects the next of 0.1 0.25 0.5 1 2 4 8.
  void faster();
  void slower();
  /// Clamped to the gesture. Ignores a reversed loop and one shorter than a step. nullopt: plays to the end.
  void setLoop(std::optional<ReplayLoop> loop);
  /// Advances by `elapsed_s` of the view's clock.
  void advance(double elapsed_s);

  [[nodiscard]] bool playing() const { return playing_; }
  [[nodiscard]] double at_s() const { return at_s_; }
  [[nodiscard]] double speed() const { return speed_; }
  [[nodiscard]] double first_s() const { return first_s_; }
  [[nodiscard]] double last_s() const { return last_s_; }
  [[nodiscard]] const std::optional<ReplayLoop>& loop() const { return loop_; }

 private:
  double first_s_ = 0, last_s_ = 0, at_s_ = 0, speed_ = 1;
  bool playing_ = false;
  std::optional<ReplayLoop> loop_;
};

}  // namespace needlelab

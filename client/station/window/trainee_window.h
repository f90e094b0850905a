/// Draws the screens of the trainee's window, one frame at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "client/station/run/lesson_requests.h"
#include "client/station/window/frame_log.h"
#include "client/station/window/lessons/lesson_board.h"
#include "client/station/window/screens/end_screen.h"
#include "client/station/window/screens/lesson_follow.h"
#include "client/station/window/screens/lesson_screen.h"
#include "client/station/window/screens/start_screen.h"
#include "client/view/action_bar.h"
#include "client/view/scene/scene_renderer.h"
#include "common/base/result.h"

namespace needlelab {

/// Shows the board's state and sends a person's requests to it. Thread: the surface's.
class TraineeWindow {
 public:
  /// Needs a surface. Errors: from SceneRenderer::make.
  /// `may_quit`: false with --no-quit.
  static Result<std::unique_ptr<TraineeWindow>> make(LessonBoard& board, LessonRequests& requests,
                                                     bool may_quit = true);

  /// Call between Surface::beginFrame and endFrame.
  void frame();
  /// Asks whether to quit, and says what happens to the lesson. Does nothing without `may_quit`.
  void askToQuit();

  /// Returns the state shown in the last frame.
  [[nodiscard]] const BoardState& shown() const { return state_; }
  /// Returns the lesson time of the newest sample shown, in s.
  [[nodiscard]] double lessonTime_s() const;
  /// Returns what the last frame showed.
  [[nodiscard]] ShownFrame shownFrame() const;

 private:
  TraineeWindow(LessonBoard& board, LessonRequests& requests, std::unique_ptr<SceneRenderer> renderer,
                bool may_quit);
  void follow();
  /// Returns whether the person wants to quit.
  bool showScreen(bool changed, bool keys);
  void showQuestion();
  void offerExam();
  void showHand();

  LessonBoard& board_;
  LessonRequests& requests_;
  const bool may_quit_;
  Question quit_question_{"Quit?"}, exam_question_{"Begin the exam?"};
  std::unique_ptr<SceneRenderer> renderer_;
  BoardState state_;
  std::uint64_t seen_ = 0, lesson_ = 0;
  std::vector<LessonBoard::Taken> pieces_;
  std::unique_ptr<LessonFollow> follow_;
  StartScreen start_;
  LessonScreen lesson_screen_;
  EndScreen end_;
};

}  // namespace needlelab

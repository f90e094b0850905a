#include "client/station/window/trainee_window.h"

#include <imgui/imgui.h>

#include <utility>

#include "client/station/run/terminal.h"
#include "client/view/theme.h"

namespace needlelab {

Result<std::unique_ptr<TraineeWindow>> TraineeWindow::make(LessonBoard& board, LessonRequests& requests) {
  ASSIGN_OR_RETURN(auto renderer, SceneRenderer::make());
  // arrows, Space and Enter steer the needle and begin lessons: they must not activate the focused widget
  ImGui::GetIO().ConfigFlags &= ~ImGuiConfigFlags_NavEnableKeyboard;
  return std::unique_ptr<TraineeWindow>(new TraineeWindow(board, requests, std::move(renderer)));
}

TraineeWindow::TraineeWindow(LessonBoard& board, LessonRequests& requests,
                             std::unique_ptr<SceneRenderer> renderer)
    : board_(board), requests_(requests), renderer_(std::move(renderer)), lesson_screen_(*renderer_) {}

double TraineeWindow::lessonTime_s() const {
  return follow_ && follow_->begun() ? follow_->now().time_s : 0;
}

// follows a new lesson and its new samples
void TraineeWindow::follow() {
  if (state_.lesson != lesson_ && state_.beginning) {
    lesson_ = state_.lesson;
    auto follow = LessonFollow::make(state_.beginning);
    if (!follow.ok()) {
      logMessage("the window cannot show this lesson: " + follow.error().message);
      follow_.reset();
      return;
    }
    follow_ = std::move(*follow);
    lesson_screen_.begin(*follow_);
  }
  if (!follow_) return;
  samples_.clear();
  const std::uint64_t dropped = board_.takeSamples(lesson_, samples_);
  follow_->feed(samples_, dropped);
}

void TraineeWindow::frame() {
  const bool changed = board_.look(state_, seen_);
  follow();
  switch (state_.stage) {
    case Stage::kOpening:
    case Stage::kPreparing:
      return showPreparing(state_, requests_);
    case Stage::kStart:
      return start_.show(state_, changed, board_);
    case Stage::kLesson:
    case Stage::kConcluding:
      if (follow_) return lesson_screen_.show(state_, *follow_, requests_);
      return showPreparing(state_, requests_);
    case Stage::kEnd:
    case Stage::kClosing:
      if (state_.outcome)
        return end_.show(state_, changed, follow_ ? follow_->scene().get() : nullptr, board_);
      return showPreparing(state_, requests_);
    case Stage::kFailed:
      return showFailed(state_, board_);
  }
}

}  // namespace needlelab

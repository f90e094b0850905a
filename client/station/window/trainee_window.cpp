#include "client/station/window/trainee_window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <imgui/imgui.h>

#include <utility>

#include "client/station/run/io/terminal.h"
#include "client/station/window/lessons/start_choice.h"
#include "client/station/window/screens/lesson_screen.h"
#include "client/station/window/screens/station_actions.h"
#include "client/view/theme.h"

namespace needlelab {

Result<std::unique_ptr<TraineeWindow>> TraineeWindow::make(LessonBoard& board, LessonRequests& requests,
                                                           bool may_quit) {
  ASSIGN_OR_RETURN(auto renderer, SceneRenderer::make());
  // arrows, Space and Enter steer the needle and begin lessons: they must not activate the focused widget
  ImGui::GetIO().ConfigFlags &= ~ImGuiConfigFlags_NavEnableKeyboard;
  return std::unique_ptr<TraineeWindow>(new TraineeWindow(board, requests, std::move(renderer), may_quit));
}

TraineeWindow::TraineeWindow(LessonBoard& board, LessonRequests& requests,
                             std::unique_ptr<SceneRenderer> renderer, bool may_quit)
    : board_(board),
      requests_(requests),
      may_quit_(may_quit),
      renderer_(std::move(renderer)),
      lesson_screen_(*renderer_),
      end_(*renderer_) {}

double TraineeWindow::lessonTime_s() const {
  return follow_ && follow_->begun() ? follow_->now().time_s : 0;
}

ShownFrame TraineeWindow::shownFrame() const {
  ShownFrame frame;
  frame.stage = state_.stage;
  const bool in_lesson = state_.stage == Stage::kLesson || state_.stage == Stage::kConcluding;
  frame.question = quit_question_.shown()                        ? ShownQuestion::kQuit
                   : exam_question_.shown()                      ? ShownQuestion::kBeginExam
                   : in_lesson && lesson_screen_.isOfferingEnd() ? ShownQuestion::kEndLesson
                                                                 : ShownQuestion::kNone;
  frame.can_begin = !quit_question_.asked() && ((state_.stage == Stage::kStart && start_.canBegin()) ||
                                                (state_.stage == Stage::kEnd && end_.acceptsKeys()));
  frame.lesson = state_.lesson;
  frame.lesson_s = lessonTime_s();
  if (follow_ && follow_->begun()) {
    const Moment& now = follow_->now();
    frame.depth_m = now.depth_m;
    frame.plunger = now.plunger;
    frame.p_WT_m = now.p_WT_m;
  }
  if (in_lesson) frame.aim_WT_m = lesson_screen_.aim_W_m().value_or(kNowhere_m);
  return frame;
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
  // one by one, however many wait: each has its own paths
  std::uint64_t dropped = board_.takePieces(lesson_, pieces_);
  for (const LessonBoard::Taken& piece : pieces_)
    follow_->feed(*piece.samples, std::exchange(dropped, 0), piece.cut_memory, piece.paths);
}

void TraineeWindow::askToQuit() {
  if (may_quit_ && !quit_question_.asked()) quit_question_.ask();
}

// over every screen, with a server, as it has instructors
void TraineeWindow::showHand() {
  if (state_.server.empty()) return;
  if (ImGui::IsKeyPressed(GLFW_KEY_F2, false)) requests_.switchHand();
  if (!requests_.handRaised()) return;
  const bool away = serverFact(state_.server).condition != Condition::kGood;
  const char* const words = away ? "Your hand is up. No server: call out. F2 lowers it."
                                 : "Your hand is up: the instructor sees it. F2 lowers it.";
  const ImVec2 screen = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({0.5F * screen.x, screen.y}, ImGuiCond_Always, {0.5F, 1});
  ImGui::SetNextWindowSize({ImGui::CalcTextSize(words).x + 8 * space(), 0});
  if (ImGui::Begin("##hand", nullptr, kLaidOver)) conditionLine(Condition::kAttention, words);
  ImGui::End();
}

void TraineeWindow::frame() {
  const bool changed = board_.look(state_, seen_);
  follow();
  if (showScreen(changed, !quit_question_.asked())) askToQuit();
  offerExam();
  showQuestion();
  showHand();
}

bool TraineeWindow::showScreen(bool changed, bool keys) {
  switch (state_.stage) {
    case Stage::kOpening:
    case Stage::kPreparing:
      showPreparing(state_, requests_);
      return false;
    case Stage::kStart:
      return start_.show(state_, changed, keys, may_quit_, board_);
    case Stage::kLesson:
    case Stage::kConcluding:
      if (follow_)
        lesson_screen_.show(state_, *follow_, keys, requests_);
      else
        showPreparing(state_, requests_);
      return false;
    case Stage::kEnd:
    case Stage::kClosing:
      if (state_.outcome) return end_.show(state_, changed, follow_.get(), keys, may_quit_, board_);
      showPreparing(state_, requests_);
      return false;
    case Stage::kFailed:
      return showFailed(state_, keys, may_quit_);
  }
  return false;
}

// a question to quit takes its place
void TraineeWindow::offerExam() {
  if (state_.exam_terms.empty())
    exam_question_.withdraw();
  else if (!exam_question_.asked() && !quit_question_.asked())
    exam_question_.ask();
  const auto& curriculum = state_.lists.curriculum;
  std::string who = state_.choice.trainee;
  if (curriculum) who = shownName(curriculum->trainees, who);
  const std::string text =
      exerciseName(state_.lists, state_.choice.exercise) + "\n" + who + ": " + state_.exam_terms;
  const auto answer = exam_question_.show(text.c_str(), beginExamActions());
  if (answer) state_.exam_terms.clear();
  if (answer == kActYes) requests_.beginExam();
  if (answer == kActNo) requests_.stop({});
}

void TraineeWindow::showQuestion() {
  if (quit_question_.show(quitText(state_).c_str(), quitActions()) != kActYes) return;
  requests_.stop({});
  board_.ask({BoardRequest::Kind::kQuit, {}});
}

}  // namespace needlelab

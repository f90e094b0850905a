#include "client/station/window/lessons/lesson_board.h"

#include <algorithm>
#include <utility>

#include "common/base/secret.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxMessages = 50;

}  // namespace

bool LessonBoard::look(BoardState& state, std::uint64_t& seen) const {
  const std::scoped_lock lock(mutex_);
  if (seen == revision_) return false;
  seen = revision_;
  state = state_;
  return true;
}

std::uint64_t LessonBoard::takePieces(std::uint64_t lesson, std::vector<Taken>& pieces) {
  std::deque<Waiting> all;
  std::uint64_t dropped = 0;
  {
    const std::scoped_lock lock(mutex_);
    all.swap(pieces_);
    dropped = std::exchange(dropped_since_, 0);
  }
  pieces.clear();
  for (Waiting& waiting : all)
    if (waiting.lesson == lesson) pieces.push_back(std::move(waiting.piece));
  return dropped;
}

void LessonBoard::ask(BoardRequest request) {
  {
    const std::scoped_lock lock(mutex_);
    if (request.kind == BoardRequest::Kind::kQuit) quit_ = true;
    // the window requests standings by itself; this must not replace a person's request
    const bool by_itself = request.kind == BoardRequest::Kind::kTrainee;
    if (by_itself && request_.kind != BoardRequest::Kind::kNothing && request_.kind != request.kind) return;
    wipe(request_.code);
    request_ = std::move(request);
  }
  requested_.notify_all();
}

BoardRequest LessonBoard::waitForRequest(std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  const std::int64_t due_ns = time_.nowNs() + std::chrono::nanoseconds(patience).count();
  time_.waitUntilNs(requested_, lock, due_ns,
                    [this] { return quit_ || request_.kind != BoardRequest::Kind::kNothing; });
  if (quit_) return {BoardRequest::Kind::kQuit, {}};
  BoardRequest request = request_;
  wipe(request_.code);
  request_ = {};
  return request;
}

bool LessonBoard::requestWaits() const {
  const std::scoped_lock lock(mutex_);
  const bool by_person =
      request_.kind != BoardRequest::Kind::kNothing && request_.kind != BoardRequest::Kind::kTrainee;
  return quit_ || by_person;
}

std::uint64_t LessonBoard::droppedBatches() const {
  const std::scoped_lock lock(mutex_);
  return dropped_;
}

void LessonBoard::preparing(const std::string& what) {
  change([&](BoardState& state) { state.preparing = what; });
}

void LessonBoard::examWaits(const std::string& terms) {
  change([&](BoardState& state) { state.exam_terms = terms; });
}

void LessonBoard::began(std::shared_ptr<const LessonBeginning> beginning) {
  const auto aids = beginning->lesson.exercise ? aidsOfExercise(*beginning->lesson.exercise) : usualAids();
  change([&](BoardState& state) {
    pieces_.clear();
    dropped_since_ = 0;
    ++state.lesson;
    state.stage = Stage::kLesson;
    state.beginning = std::move(beginning);
    state.status = {};
    state.aids = aids;
    state.aids_by.clear();
    state.outcome.reset();
    state.trouble.clear();
    // removes the messages of earlier lessons
    state.messages.clear();
  });
}

void LessonBoard::status(const LessonStatus& status) {
  change([&](BoardState& state) {
    state.status = status;
    state.server = status.server;
  });
}

void LessonBoard::aids(const ChosenAids& chosen) {
  change([&](BoardState& state) {
    const auto& exercise = state.beginning->lesson.exercise;
    state.aids = !chosen.reset ? chosen.aids : exercise ? aidsOfExercise(*exercise) : usualAids();
    state.aids_by = chosen.reset ? "" : printable(chosen.by);
  });
}

void LessonBoard::concluding() {
  change([](BoardState& state) { state.stage = Stage::kConcluding; });
}

void LessonBoard::message(const std::string& from, const std::string& text) {
  change([&](BoardState& state) {
    BoardMessage message{printable(from), printable(text), wallNowNs(), -1};
    if (state.stage == Stage::kLesson) message.lesson_s = state.status.time_s;
    state.messages.push_back(std::move(message));
    if (state.messages.size() > kMaxMessages) state.messages.erase(state.messages.begin());
  });
}

void LessonBoard::nextExercise(const std::string& from, const std::string& exercise_id) {
  change([&](BoardState& state) {
    state.next = SuggestedExercise{printable(from), printable(exercise_id)};
    // on the Start screen, preselects it at once; during a lesson, it waits for the end
    if (state.stage != Stage::kStart) return;
    state.choice.exercise = state.next->exercise;
    state.choice.by_profile = false;
  });
}

void LessonBoard::piece(const SamplePiece& piece) {
  if (!piece.samples) return;
  const std::scoped_lock lock(mutex_);
  if (pieces_.size() >= max_pieces_) {
    dropped_since_ += pieces_.front().piece.samples->size();
    pieces_.pop_front();
    ++dropped_;
  }
  pieces_.push_back({{piece.samples, piece.cut_memory, piece.paths}, state_.lesson});
}

}  // namespace needlelab

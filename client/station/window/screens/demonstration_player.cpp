#include "client/station/window/screens/demonstration_player.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace needlelab {
namespace {

constexpr double kStaysAtEnd_s = 1, kLongestStep_s = 0.2;

}  // namespace

void DemonstrationPlayer::begin() {
  stop();
  coming_ = {};
  made_ = nullptr;
  trouble_.clear();
}

void DemonstrationPlayer::play(const LessonFollow& lesson) {
  stop();
  wanted_ = true;
  if (made_ || coming_.valid()) return;
  coming_ = std::async(std::launch::async, [beginning = lesson.sharedBeginning()] {
    return demonstrationOf(beginning->lesson, beginning->X_WL,
                           beginning->lesson.model.isLive(Effect::kPalpation));
  });
}

void DemonstrationPlayer::advance(const LessonFollow& lesson, double dt_s) {
  using std::chrono_literals::operator""s;
  if (coming_.valid() && coming_.wait_for(0s) == std::future_status::ready) {
    auto made = coming_.get();
    if (made.ok())
      made_ = std::make_shared<const Demonstration>(*std::move(made));
    else
      trouble_ = made.error().message;
  }
  if (!trouble_.empty()) stop();
  if (!wanted_ || !made_) return;
  if (!shown_) shown_ = lesson.restarted(), time_s_ = 0, fed_ = 0;
  time_s_ += std::clamp(dt_s, 0.0, kLongestStep_s);
  for (; fed_ < made_->pieces.size() && static_cast<double>(fed_) * made_->piece_s < time_s_; ++fed_) {
    const Demonstration::Piece& piece = made_->pieces[fed_];
    shown_->feed(piece.samples, 0, piece.cut_memory, piece.paths);
  }
  if (time_s_ > made_->duration_s() + kStaysAtEnd_s) stop();
}

double DemonstrationPlayer::progress() const {
  return made_ && shown_ ? std::min(1.0, time_s_ / made_->duration_s()) : 0;
}

}  // namespace needlelab

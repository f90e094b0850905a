#include "client/instructor/model/stored/replay_player.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace needlelab {
namespace {

constexpr std::array kSpeeds = {0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0};

}  // namespace

void ReplayPlayer::load(double first_s, double last_s) {
  *this = {};
  first_s_ = at_s_ = std::isfinite(first_s) ? first_s : 0;
  last_s_ = std::isfinite(last_s) ? std::max(first_s_, last_s) : first_s_;
}

void ReplayPlayer::play() {
  const double end_s = loop_ ? loop_->to_s : last_s_;
  if (at_s_ >= end_s) at_s_ = loop_ ? loop_->from_s : first_s_;
  playing_ = last_s_ > first_s_;
}

void ReplayPlayer::seek(double time_s) {
  if (std::isfinite(time_s)) at_s_ = std::clamp(time_s, first_s_, last_s_);
}

void ReplayPlayer::step(int steps) {
  pause();
  seek(at_s_ + steps * kReplayStep_s);
}

void ReplayPlayer::setSpeed(double speed) {
  if (std::isfinite(speed)) speed_ = std::clamp(speed, kSlowestReplay, kFastestReplay);
}

void ReplayPlayer::faster() {
  const auto next = std::upper_bound(kSpeeds.begin(), kSpeeds.end(), speed_ * (1 + 1e-9));
  if (next != kSpeeds.end()) speed_ = *next;
}

void ReplayPlayer::slower() {
  const auto here = std::lower_bound(kSpeeds.begin(), kSpeeds.end(), speed_ * (1 - 1e-9));
  if (here != kSpeeds.begin()) speed_ = *(here - 1);
}

void ReplayPlayer::setLoop(std::optional<ReplayLoop> loop) {
  loop_.reset();
  if (!loop || !std::isfinite(loop->from_s) || !std::isfinite(loop->to_s)) return;
  const ReplayLoop held{std::clamp(loop->from_s, first_s_, last_s_),
                        std::clamp(loop->to_s, first_s_, last_s_)};
  if (held.to_s - held.from_s >= kReplayStep_s) loop_ = held;
}

void ReplayPlayer::advance(double elapsed_s) {
  if (!playing_ || !(elapsed_s > 0)) return;
  at_s_ += speed_ * elapsed_s;
  // playback that starts before the loop continues into it
  if (loop_ && at_s_ >= loop_->to_s) {
    const double length_s = loop_->to_s - loop_->from_s;
    at_s_ = loop_->from_s + std::fmod(at_s_ - loop_->to_s, length_s);
    return;
  }
  if (at_s_ >= last_s_) {
    at_s_ = last_s_;
    playing_ = false;
  }
}

}  // namespace needlelab

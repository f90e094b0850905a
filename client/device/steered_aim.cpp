#include "client/device/steered_aim.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/device/turn_vector.h"

namespace needlelab {
namespace {

constexpr double kFollow_per_s = 8;   // speed by distance: a quarter of it is left after 0.17 s
constexpr double kSpeedUp_s = 0.025;  // 8/s · 25 ms is below 1/4: no overshoot
constexpr double kRotationError = 1e-3;

bool isUsable(const SteeringWish& wish) {
  return isFinite(wish.X_WT.p) && isFinite(wish.X_WT.q) && std::isfinite(wish.plunger) &&
         std::abs(dot(wish.X_WT.q, wish.X_WT.q) - 1) <= kRotationError;
}

Vec3 atMost(Vec3 v, double length) {
  const double is = norm(v);
  return is > length ? v * (length / is) : v;
}

}  // namespace

SteeredAim::SteeredAim(std::shared_ptr<HandSteering> steering, const HandAim& start, double step_s)
    : steering_(std::move(steering)),
      step_s_(step_s),
      share_(step_s / kSpeedUp_s),
      aim_(start),
      wish_{start.X_WT, start.plunger} {}

HandAim SteeredAim::next() noexcept {
  if (SteeringWish newest; steering_->fetch(newest) && isUsable(newest)) {
    newest.X_WT.q = normalized(newest.X_WT.q);
    newest.plunger = std::clamp(newest.plunger, 0.0, 1.0);
    wish_ = newest;
  }
  Pose& X = aim_.X_WT;
  v_W_mps_ += (atMost((wish_.X_WT.p - X.p) * kFollow_per_s, kMostAimSpeed_mps) - v_W_mps_) * share_;
  X.p += v_W_mps_ * step_s_;
  const Vec3 turn = turnVector(X.q, wish_.X_WT.q);
  w_W_radps_ += (atMost(turn * kFollow_per_s, kMostAimTurn_radps) - w_W_radps_) * share_;
  const Vec3 half = w_W_radps_ * (step_s_ / 2);
  X.q = normalized(Quat{half.x, half.y, half.z, 1} * X.q);
  const double most = kMostPlungerSpeed_per_s * step_s_;
  aim_.plunger += std::clamp(wish_.plunger - aim_.plunger, -most, most);
  return aim_;
}

}  // namespace needlelab

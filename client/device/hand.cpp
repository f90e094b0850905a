#include "client/device/hand.h"

#include <algorithm>
#include <utility>

#include "client/device/turn_vector.h"

namespace needlelab {
namespace {

constexpr double kMaxCorrection_m = 0.05;

}  // namespace

Hand::Hand(const HandOptions& options, HandPlan plan, const Pose& X_HT, double step_s,
           std::shared_ptr<HandSteering> steering)
    : options_(options),
      plan_(std::move(plan)),
      X_TH_(inverse(X_HT)),
      step_s_(step_s),
      tremor_(options.tremor_m, options.seed, step_s),
      // a device is read before the hand's first step
      plunger_(plan_.start().plunger),
      wanted_(startPose()) {
  if (steering) steered_.emplace(std::move(steering), plan_.start(), step_s);
}

Pose Hand::startPose() const {
  return plan_.start().X_WT * X_TH_;
}

bool Hand::finished() const noexcept {
  if (steered_) return false;
  const double all = plan_.duration_s() * static_cast<double>(options_.repeat);
  return options_.repeat != 0 && static_cast<double>(step_) * step_s_ >= all;
}

HandAim Hand::plannedAim() const noexcept {
  // time within the plan; whole repeats are taken off
  double t = static_cast<double>(step_) * step_s_;
  if (const double duration = plan_.duration_s(); duration > 0 && t >= duration) {
    const double done = static_cast<double>(static_cast<std::int64_t>(t / duration));
    const bool last = options_.repeat != 0 && done >= static_cast<double>(options_.repeat);
    t = last ? duration : std::max(0.0, t - done * duration);
  }
  return plan_.at(t);
}

Wrench Hand::pull(const HandleState& handle) noexcept {
  const HandAim aim = steered_ ? steered_->next() : plannedAim();
  plunger_ = aim.plunger;

  // the tip's aim with tremor and correction, moved to the handle; its velocity from the step before
  const Pose before = wanted_;
  const Pose planned = aim.X_WT * X_TH_;
  if (options_.correction_per_s > 0) {
    correction_W_m_ += (planned.p - handle.X_WH.p) * (options_.correction_per_s * step_s_);
    if (const double far = norm(correction_W_m_); far > kMaxCorrection_m)
      correction_W_m_ = correction_W_m_ * (kMaxCorrection_m / far);
  }
  wanted_ = {planned.p + correction_W_m_ + tremor_.next(), planned.q};
  const double per_s = step_ == 0 ? 0 : 1 / step_s_;
  const Vec3 v_wanted = (wanted_.p - before.p) * per_s;
  const Vec3 w_wanted = turnVector(before.q, wanted_.q) * per_s;
  const double since_start_s = static_cast<double>(step_) * step_s_;
  ++step_;
  if (options_.let_go_s > 0 && since_start_s >= options_.let_go_s) return {};

  return {options_.stiffness_N_per_m * (wanted_.p - handle.X_WH.p) +
              options_.damping_Ns_per_m * (v_wanted - handle.v_W_mps),
          options_.rotational_stiffness_Nm_per_rad * turnVector(handle.X_WH.q, wanted_.q) +
              options_.rotational_damping_Nms_per_rad * (w_wanted - handle.w_W_radps)};
}

}  // namespace needlelab

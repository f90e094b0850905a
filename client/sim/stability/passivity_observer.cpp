#include "client/sim/stability/passivity_observer.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

double workBetween(const TipSample& from, const Wrench& before, const TipSample& to, const Wrench& now) {
  const double force_J = 0.5 * dot(before.force_N + now.force_N, to.p_WT_m - from.p_WT_m);
  // the rotation vector from one to the other in W, to first order exact enough for neighbouring ticks
  const Quat turn = to.q_WT * conjugate(from.q_WT);
  const double sign = turn.w < 0 ? -2.0 : 2.0;
  const Vec3 angle = Vec3{turn.x, turn.y, turn.z} * sign;
  return force_J + 0.5 * dot(before.torque_Nm + now.torque_Nm, angle);
}

void PassivityObserver::add(const TipSample& tip, const StepReport& report, double slant) {
  const Wrench& now = report.wrench_W;
  ++record_.ticks;
  record_.flags |= report.flags;
  if (!isFinite(now.force_N) || !isFinite(now.torque_Nm)) {
    record_.finite = false;
    return;
  }
  record_.max_force_N = std::max(record_.max_force_N, norm(now.force_N));
  if (report.flags & kFlagEntry) {
    ++record_.insertions;
    insertion_J_ = 0;
  }
  if (last_) {
    const double work_J = workBetween(last_->tip, last_->wrench_W, tip, now);
    record_.net_J += work_J;
    insertion_J_ += work_J;
    record_.worst_running_J = std::max(record_.worst_running_J, insertion_J_);
    if (report.flags & kFlagExit)
      record_.worst_insertion_J = std::max(record_.worst_insertion_J, insertion_J_);

    if ((report.flags & kDeclaredReleases) == 0) {
      const double stiffness =
          axial_N_per_m_ + std::max(last_->clamping_N_per_m, report.clamping_stiffness_N_per_m);
      const double explained = stiffness * norm(tip.p_WT_m - last_->tip.p_WT_m) / slant;
      const double beyond = norm(now.force_N - last_->wrench_W.force_N) - explained;
      if (beyond > record_.worst_step_N) {
        record_.worst_step_N = beyond;
        record_.worst_step_tick = record_.ticks - 1;
      }
    }
    if ((report.flags & kFlagExit) == 0)
      record_.worst_torque_step_Nm =
          std::max(record_.worst_torque_step_Nm, norm(now.torque_Nm - last_->wrench_W.torque_Nm));
  }
  last_ = Seen{tip, now, report.clamping_stiffness_N_per_m};
}

}  // namespace needlelab

#include "client/sim/stability/gestures/passivity_observer.h"

#include <algorithm>
#include <cmath>

#include "client/sim/stability/loop/measures.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
double workBetween(const TipSample& from, const Wrench& before, const TipSample& to, const Wrench& now) {
  const double force_J = 0.5 * dot(before.force_N + now.force_N, to.p_WT_m - from.p_WT_m);
  // rotation vector between the two in W, to first order; accurate enough for neighbouring ticks
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
    const double work_J = workBetween(last_->tip, last_->report.wrench_W, tip, now);
    record_.net_J += work_J;
    insertion_J_ += work_J;
    record_.worst_running_J = std::max(record_.worst_running_J, insertion_J_);
    const double beyond =
        unexplainedStep_N(last_->tip.p_WT_m, last_->report, tip.p_WT_m, report, axial_N_per_m_, slant);
    record_.worst_step_N = std::max(record_.worst_step_N, beyond);
    if ((report.flags & kFlagExit) == 0)
      record_.worst_torque_step_Nm =
          std::max(record_.worst_torque_step_Nm, norm(now.torque_Nm - last_->report.wrench_W.torque_Nm));
  }
  last_ = Seen{tip, report};
}

namespace {

// what the effects' forces change with the tip's place besides the springs along the needle
double slopeOfEffects_N_per_m(const SceneSpec& scene) {
  double slope_N_per_m = 0;
  for (const EffectEntry* entry : effectEntries())
    if (entry->slope_N_per_m != nullptr && (scene.effects & bitOf(entry->effect)) != 0)
      slope_N_per_m += entry->slope_N_per_m(scene);
  return slope_N_per_m;
}

}  // namespace

Result<PassivityRecord> runGesture(const PassivityGesture& gesture, AxialModel model,
                                   const ForceSourceFactory& make_source) {
  ASSIGN_OR_RETURN(auto scene, sceneSpecOf(gesture.profile));
  ASSIGN_OR_RETURN(auto source, make_source(likeForLike(scene, model), gesture.rate_hz));
  PassivityObserver observer(source->axialStiffness_N_per_m() + slopeOfEffects_N_per_m(scene));
  StepReport report;
  for (const TipSample& tip : samplesOf(gesture)) {
    source->step(tip, report);
    observer.add(tip, report, source->slant());
  }
  return observer.record();
}

double judgedEnergy_J(const PassivityRecord& record) {
  return std::max(record.net_J, record.worst_running_J);
}

std::optional<PassivityFinding> findingOf(const PassivityRecord& record, const PassivityLimits& limits,
                                          std::optional<PassivityCheck> only) {
  for (const PassivityFinding& one :
       {PassivityFinding{PassivityCheck::kFinite, record.finite ? 0.0 : 1.0, 0},
        PassivityFinding{PassivityCheck::kEnergy, judgedEnergy_J(record), limits.energy_J},
        PassivityFinding{PassivityCheck::kForceStep, record.worst_step_N, limits.step_N}})
    if (one.check == only.value_or(one.check) && !(one.measured <= one.limit)) return one;
  return std::nullopt;
}

namespace {

void worsen(PassivityRecord& worst, const PassivityRecord& one) {
  worst.finite = worst.finite && one.finite;
  for (double PassivityRecord::*member :
       {&PassivityRecord::max_force_N, &PassivityRecord::net_J, &PassivityRecord::worst_running_J,
        &PassivityRecord::worst_step_N, &PassivityRecord::worst_torque_step_Nm})
    worst.*member = std::max(worst.*member, one.*member);
  worst.ticks += one.ticks;
  worst.insertions += one.insertions;
  worst.flags |= one.flags;
}

}  // namespace

Result<GestureFindings> searchGestures(const GestureSearch& search, AxialModel model,
                                       const ForceSourceFactory& source, const GestureFails& fails) {
  GestureFindings findings;
  findings.worst.net_J = -1e9;  // net energies of gestures are usually negative
  const std::uint64_t stages_from = search.first_seed + search.gestures;
  for (std::uint64_t seed = search.first_seed; seed < stages_from + search.with_stages; ++seed) {
    GestureRange range = search.range;
    range.stages = range.stages || seed >= stages_from;
    PassivityGesture gesture = randomGesture(seed, range);
    gesture.rate_hz = search.rate_hz;
    ASSIGN_OR_RETURN(const auto record, runGesture(gesture, model, source));
    ++findings.gestures;
    worsen(findings.worst, record);
    const auto finding = findingOf(record, search.limits);
    if (!finding) continue;
    ++findings.failed;
    if (fails && !fails(seed, gesture, *finding)) break;
  }
  return findings;
}

}  // namespace needlelab

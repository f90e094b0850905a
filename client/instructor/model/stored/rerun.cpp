#include "client/instructor/model/stored/rerun.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "client/view/model/gesture_replica.h"
#include "common/base/text/text.h"
#include "common/haptics/body/body_engine.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

/// A moment of the run: the tip from the recording, everything else from the engine.
Moment momentOfStep(const GestureSample& sample, double rate_hz, const StepReport& report,
                    const SimState& state, double needle_length_m) {
  Moment moment = momentOfSample(sample, rate_hz);
  moment.force_W_N = report.wrench_W.force_N;
  moment.torque_W_Nm = report.wrench_W.torque_Nm;
  moment.wall_W_m = report.p_wall_W_m;
  moment.phase = report.phase;
  moment.layer = report.layer;
  moment.insertion_m = report.insertion_m;
  moment.speed_mps = report.speed_mps;
  moment.lateral_error_m = report.lateral_error_m;
  moment.flags = report.flags;
  moment.fault = 0;
  moment.depth_m = report.depth_m;
  moment.terms = termsOf(report);
  moment.alpha_rad = orientationLimitAngle(needle_length_m, report.insertion_m);
  moment.inside = state.inside;
  moment.approximate = false;
  if (!state.inside) return moment;
  moment.p_entry_W_m = state.p_entry_W_m;
  moment.u_W = state.u_W;
  const Vec3 axis_W = zAxis(moment.q_WT);
  moment.tilt_rad = std::atan2(norm(cross(axis_W, state.u_W)), dot(axis_W, state.u_W));
  return moment;
}

/// The session with the chosen profile.
Result<pb::SessionDescription> chosen(const StoredGesture& gesture, const RerunChoice& choice) {
  pb::SessionDescription description = gesture.info.description();
  if (!choice.profile_json.empty()) {
    description.set_profile_json(choice.profile_json);
    // stiffness and effects were limited for the session's own profile
    description.clear_stiffness_share();
    description.clear_delay_stiffness_share();
    description.clear_live_effects();
  }
  ASSIGN_OR_RETURN(auto profile, parseProfile(description.profile_json(), "the profile of the re-run"));
  if (!choice.axial_model.empty()) {
    RETURN_IF_ERROR(chooseModel(profile, choice.axial_model));
  }
  description.set_profile_json(profileJson(profile));
  if (gesture.thinned)
    description.set_rate_hz(
        std::clamp(gesture.info.removed_original().thinned_rate_hz(), 50.0, gesture.rate_hz));
  return description;
}

void describe(Rerun& run, const StoredGesture& gesture) {
  run.sentences.push_back(
      fmt::format("greatest force {:.2f} N, as recorded {:.2f} N", run.peak_force_N, run.felt_peak_N));
  run.sentences.push_back(
      fmt::format("mean force in tissue {:.2f} N, as recorded {:.2f} N; it differs by {} N on average",
                  run.mean_force_in_tissue_N, run.felt_mean_in_tissue_N,
                  fixedText(run.mean_difference_N, 2, Sign::kBoth)));
  run.sentences.push_back(
      "the recorded hand did not feel this: with other forces it would have moved differently");
  if (!gesture.info.description().capped_on_pieces() &&
      std::ranges::any_of(gesture.samples,
                          [](const GestureSample& s) { return (s.flags & kFlagCapped) != 0; }))
    run.sentences.push_back("recorded before 1.0: forces with the cap on are not exact");
  if (gesture.thinned)
    run.sentences.push_back("thinned recording: forces that depend on speed are less exact");
}

}  // namespace

Result<Rerun> rerunGesture(const StoredGesture& gesture, const RerunChoice& choice,
                           const ScenePreparer& prepare, const std::function<bool()>& stop,
                           const std::function<void(const StepReport&)>& each) {
  ASSIGN_OR_RETURN(const auto description, chosen(gesture, choice));
  Rerun run;
  run.scene = sceneOfSession(description, prepare);
  if (!run.scene.model) return Error{ErrorCode::kInvalidInput, run.scene.why};
  run.what = run.scene.profile.id() + ", " +
             std::string(kAxialModelNames[static_cast<std::size_t>(run.scene.model->axial_model)]);
  const double span_s = gesture.last_s() - gesture.first_s() + 1;
  run.trace = traceOf(run.scene, std::max(10.0, span_s), gesture.ticks_per_sample);

  const double needle_length_m = run.scene.model->needle_length_m;
  SceneEngine engine(*run.scene.model);
  StepReport report;
  double sum_N = 0, felt_sum_N = 0, difference_N = 0;
  std::uint64_t in_tissue = 0, felt_in_tissue = 0, in_either = 0;
  for (const GestureSample& sample : gesture.samples) {
    if (stop && run.ticks % 8192 == 0 && stop()) return Error{ErrorCode::kFailed, "stopped"};
    // the trainee's cap; a scene without PALPATION has none, and its needle goes in
    if ((sample.flags & kFlagNotStepped) == 0) engine.wantCap((sample.flags & kFlagCapped) != 0);
    engine.step({{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]},
                 {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}},
                report);
    ++run.ticks;
    if (each) each(report);
    run.trace.push(momentOfStep(sample, gesture.rate_hz, report, engine.state(), needle_length_m));

    const double force_N = norm(report.wrench_W.force_N);
    const double felt_N = norm({sample.force_W_N[0], sample.force_W_N[1], sample.force_W_N[2]});
    if (!std::isfinite(felt_N)) continue;
    run.peak_force_N = std::max(run.peak_force_N, force_N);
    run.felt_peak_N = std::max(run.felt_peak_N, felt_N);
    if (report.layer >= 0) sum_N += force_N, ++in_tissue;
    if (sample.layer >= 0) felt_sum_N += felt_N, ++felt_in_tissue;
    if (report.layer >= 0 || sample.layer >= 0) difference_N += force_N - felt_N, ++in_either;
  }
  const auto mean = [](double sum, std::uint64_t n) { return n == 0 ? 0.0 : sum / static_cast<double>(n); };
  run.mean_force_in_tissue_N = mean(sum_N, in_tissue);
  run.felt_mean_in_tissue_N = mean(felt_sum_N, felt_in_tissue);
  run.mean_difference_N = mean(difference_N, in_either);
  describe(run, gesture);
  return run;
}

}  // namespace needlelab

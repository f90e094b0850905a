#include "client/sim/accuracy/study.h"

#include "client/sim/accuracy/gesture.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {
namespace {

constexpr double kModelRate_hz = 1000;

// a gesture and the force that the scene prescribes for it
struct Asked {
  StudyGesture gesture;
  std::vector<double> force_N;
};

std::vector<Asked> askedOf(const SceneSpec& spec, std::uint64_t seeds) {
  std::vector<Asked> all;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    Asked asked{studyGesture(spec, seed, kModelRate_hz), {}};
    ForceProfile profile(spec, kModelRate_hz);
    for (std::size_t i = 0; i < asked.gesture.tips.size(); ++i)
      asked.force_N.push_back(
          profile.next(signedDepth(spec.limb, asked.gesture.tips[i].p_WT_m), asked.gesture.intents[i]));
    all.push_back(std::move(asked));
  }
  return all;
}

Result<SceneModel> modelOf(const SceneSpec& spec, AxialModel model) {
  SceneSpec same = likeForLike(spec, model);
  RETURN_IF_ERROR(addCompliance(same));
  return compile(same, kModelRate_hz);
}

AccuracyRow rowOf(const StudyScene& scene, AxialModel which, const SceneModel& model,
                  const std::vector<Asked>& asked, double budget_s) {
  ErrorRuns runs;
  ErrorSum felt;
  double step_N = 0;
  for (const Asked& one : asked) {
    const std::vector<double> forces_N = axialForces(model, one.gesture);
    runs.add(errorInTissue(model, one.gesture, forces_N, one.force_N));
    step_N = std::max(step_N, greatestStep_N(model, one.gesture));
    for (const double force_N : one.force_N)
      if (force_N != 0) felt.add(force_N);
  }
  const Timing timing = timeSteps(model, asked.front().gesture, budget_s);
  AccuracyRow row;
  row.study = AccuracyStudy::kModel;
  row.scene = scene.name;
  row.model = axialModelName(which);
  row.rate_hz = kModelRate_hz;
  row.reference =
      "the scene's own force profile (cutting in, attracted out, the stop's fall), without springs";
  row.rms_error_n = runs.rms();
  row.max_error_n = runs.max();
  row.rms_error_spread_n = runs.spread();
  row.max_step_n = step_N;
  row.noticeable_n = noticeableForce_N(felt.rms());
  setTimes(row, timing, kModelRate_hz);
  row.uncertainty = spreadText(runs, "gestures") + "; " + timingText(timing);
  row.cannot_show =
      "whether the profile is right for tissue. The profile jumps at layers and at the skin, where a device "
      "renders a spring: some error is the price of a force without steps. Motion is prescribed: a model "
      "that "
      "chatters in a hand (needlelab-sim stability) shows nothing of it here";
  return row;
}

}  // namespace

Result<AccuracyRows> modelProfileStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                       std::vector<std::string>& notes) {
  ASSIGN_OR_RETURN(const auto scenes, studyScenes());
  AccuracyRows rows;
  std::size_t done = 0;
  for (const StudyScene& scene : scenes) {
    const std::vector<Asked> asked = askedOf(scene.spec, options.long_form ? 64 : 8);
    for (std::size_t m = 0; m < kAxialModelCount; ++m) {
      const auto which = static_cast<AxialModel>(m);
      progress("model: " + scene.name + ", " + std::string(axialModelName(which)),
               static_cast<double>(done++) / static_cast<double>(scenes.size() * kAxialModelCount));
      const auto model = modelOf(scene.spec, which);
      if (model.ok())
        rows.push_back(rowOf(scene, which, *model, asked, options.long_form ? 1.0 : 0.2));
      else
        notes.push_back("model: " + scene.name + ", " + std::string(axialModelName(which)) +
                        " is left out: " + model.error().message);
    }
  }
  return rows;
}

}  // namespace needlelab

#include <algorithm>
#include <deque>

#include "client/sim/accuracy/gesture.h"
#include "client/sim/accuracy/study.h"
#include "client/sim/accuracy/study_models.h"

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

// what the comparison cannot show for this row
std::string limitsOf(const StudyScene& scene, const StudyModel& study, double felt_N_per_m) {
  std::string text =
      "whether the profile is right for tissue. The profile jumps at layers and at the skin, where a device "
      "renders a spring: some error is the price of a force without steps. Motion is prescribed: a model "
      "that "
      "chatters in a hand (needlelab-sim stability) shows nothing of it here";
  if (profileHasLawOf(study.model))
    text +=
        ". The profile contains this model's own law (the wall's stop and attracted force): no choice "
        "follows from this row";
  if (study.model == AxialModel::kFem) text += ". It has " + elasticityText(study.young_factor);
  return text + assumptionRemark(study, scene.spec) +
         stiffnessRemark(felt_N_per_m, scene.spec.tracking_wall.stiffness_N_per_m, "the scene asks for");
}

AccuracyRow rowOf(const StudyScene& scene, const StudyModel& study, const SceneModel& model,
                  const std::vector<Asked>& asked) {
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
  AccuracyRow row;
  row.study = AccuracyStudy::kModel;
  row.scene = scene.name;
  row.model = axialModelName(study.model);
  row.variant = study.variant;
  row.rate_hz = kModelRate_hz;
  row.reference =
      "the scene's own force profile (cutting in, attracted out, the stop's fall), without springs";
  row.rms_error_n = runs.rms();
  row.max_error_n = runs.max();
  row.rms_error_spread_n = runs.spread();
  row.max_step_n = step_N;
  row.felt_stiffness_N_per_m = feltStiffness_N_per_m(model, scene.spec);
  row.noticeable_n = noticeableForce_N(felt.rms());
  row.own_law = profileHasLawOf(study.model);
  row.uncertainty = spreadText(runs, "gestures");
  row.cannot_show = limitsOf(scene, study, *row.felt_stiffness_N_per_m);
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
    AccuracyRows of_scene;
    std::deque<SceneModel> compiled;  // keeps its places: the ticks to be timed point to them
    std::vector<TimedTick> ticks;
    const std::vector<StudyModel> models = studyModels(scene.spec);
    for (StudyModel study : models) {
      progress(scene.name + ", " + choiceOf(study),
               static_cast<double>(done++) / static_cast<double>(scenes.size() * models.size()));
      Status made = addMesh(study, scene.spec);
      auto model = made.ok() ? compile(study.spec, kModelRate_hz) : Result<SceneModel>(made.error());
      if (!model.ok()) {
        notes.push_back("model: " + scene.name + ", " + choiceOf(study) +
                        " is left out: " + model.error().message);
        continue;
      }
      compiled.push_back(*std::move(model));
      of_scene.push_back(rowOf(scene, study, compiled.back(), asked));
      of_scene.back().instructions = instructionsOf(options, scene.name, study);
      ticks.push_back(timedSteps(compiled.back(), asked.front().gesture));
    }
    progress(scene.name + ", timing",
             static_cast<double>(done) / static_cast<double>(scenes.size() * models.size()));
    addCosts(ticks, options, kModelRate_hz, of_scene);
    rows.insert(rows.end(), of_scene.begin(), of_scene.end());
  }
  return rows;
}

}  // namespace needlelab

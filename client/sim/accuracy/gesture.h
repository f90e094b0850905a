/// Seeded gestures for the studies: what a hand wants to do in a scene, the same for every model and rate.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "client/device/hand_plan.h"
#include "client/sim/accuracy/row.h"
#include "client/sim/accuracy/study.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

/// A scene of the studies, in W.
struct StudyScene {
  std::string name;  ///< of its profile, e.g. "paper-six-layers"
  SceneSpec spec;
};

/// The paper's scenes in one and three degrees of freedom, compiled into the program.
Result<std::vector<StudyScene>> studyScenes();

/// In along the surface normal, rest, some way on or back, rest, out: depths, speeds and rests from the seed.
/// The surface must be a plane.
HandPlan studyPlan(const SceneSpec& spec, std::uint64_t seed);

/// The intention of the hand at a tick.
enum class Intent : std::uint8_t { kRest, kIn, kOut };

/// A prescribed motion of the tip: the plan with normal tremor, no device between.
struct StudyGesture {
  double rate_hz = 0;
  std::vector<TipSample> tips;
  std::vector<Intent> intents;  ///< from the plan, without tremor; above the scene's v_stop it is a movement
};
StudyGesture studyGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz);

/// Inserts to a third to nine tenths of the depth, makes strokes of 0.5 to 3 mm back and forth without a
/// rest, and withdraws. The tissue sticks and yields; the tip hardly cuts.
StudyGesture strokeGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz);

/// The force along the trajectory that the profile prescribes, without the springs that a model uses to reach
/// it: −f_cut of the layer on the way in, +f_att on the way out, in a rest the fall from there to f_rej
/// (FORCE_MODEL.md, "Tracking wall": after the dwell; linear in the stop's duration, or exponential to the
/// residual). Zero outside. It jumps at layers, as the profile does. Thread: one.
class ForceProfile {
 public:
  ForceProfile(const SceneSpec& spec, double rate_hz);

  /// One tick. `depth_m`: δ of the tip. In N, negative = against the insertion.
  double next(double depth_m, Intent intent);

 private:
  [[nodiscard]] const LayerSpec& layerAt(double depth_m) const;
  [[nodiscard]] double atRest(double depth_m) const;
  SceneSpec spec_;
  double period_s_;
  double moving_N_ = 0;  // when the hand last moved
  double rest_s_ = 0;    // since then
};

/// The force along the trajectory at each tick, in N: cutting, attracted, friction and puncture together.
std::vector<double> axialForces(const SceneModel& model, const StudyGesture& gesture);

/// Whether a change of force is a declared release: it falls at a tick that the engine flags as a layer's
/// change, a rupture or an exit. A rise at such a tick is none, and neither is a force that changes its sign.
bool isRelease(std::uint32_t flags, double before_N, double after_N);

/// Greatest change of the force along the trajectory from one tick to the next that is not a release, in N.
double greatestStep_N(const SceneModel& model, const StudyGesture& gesture);

/// Root mean square and greatest of forces − reference while the tip is in the tissue.
ErrorSum errorInTissue(const SceneModel& model, const StudyGesture& gesture,
                       const std::vector<double>& forces_N, const std::vector<double>& reference_N);

/// The engine's tick over a gesture, again and again, to be timed. Both must outlive it.
TimedTick timedSteps(const SceneModel& model, const StudyGesture& gesture);

/// The stiffness along the trajectory that a hand feels: straight in to half of the study's depth at 10 mm/s,
/// a rest of 20 ms, 0.2 mm back, again a rest; the change of force over the way, in N/m.
double feltStiffness_N_per_m(const SceneModel& model, const SceneSpec& spec);

/// ". Drawn back in the tissue it feels 43 N/m, the scene asks for 500: …", for a row's `cannot_show`; empty
/// when they are within a tenth. `comparator`: "the scene asks for".
std::string stiffnessRemark(double felt_N_per_m, double asked_N_per_m, std::string_view comparator);

/// Times the ticks in turns and fills the rows' costs, in the same order.
void addCosts(const std::vector<TimedTick>& ticks, const AccuracyOptions& options, double rate_hz,
              AccuracyRows& rows);

/// A recorded gesture with the scene in which it was made, at 1 kHz.
struct StudyLesson {
  std::string name;
  SceneModel model;
  std::vector<GestureSample> samples;
};

/// A hand in closed loop in the paper's six layers, some 30 s, with exact encoders. The times of device and
/// engine are synthetic (8-12 µs and 30-430 ns, from a seed), so that these columns vary as in a real loop.
Result<StudyLesson> generatedLesson();

/// The recorded hand movements of a real Virtuose (`DATA/virtuose`), played through a ball of the paper's
/// tissue around the point farthest from the start. Empty when the recordings are missing.
Result<std::vector<StudyLesson>> recordedLessons(const AccuracyOptions& options);

/// Runs the poses of `samples` through gate and engine again. Returns the force on the hand for each, in N.
std::vector<Vec3> recomputedForces(const SceneModel& model, const std::vector<GestureSample>& samples);

}  // namespace needlelab

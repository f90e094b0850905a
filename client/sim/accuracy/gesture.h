/// Seeded gestures for the studies: what a hand wants to do in a scene, the same for every model and rate.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/device/hand_plan.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"

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

/// What the hand means to do at a tick.
enum class Intent : std::uint8_t { kRest, kIn, kOut };

/// A prescribed motion of the tip: the plan with normal tremor, no device between.
struct StudyGesture {
  double rate_hz = 0;
  std::vector<TipSample> tips;
  std::vector<Intent> intents;  ///< from the plan, without tremor; above the scene's v_stop it is a movement
};
StudyGesture studyGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz);

/// In by a third to nine tenths of the depth, strokes of 0.5 to 3 mm there and back without a rest, and out:
/// the tissue sticks and gives way, the tip hardly cuts.
StudyGesture strokeGesture(const SceneSpec& spec, std::uint64_t seed, double rate_hz);

}  // namespace needlelab

/// "What would it have felt like": runs the engine on the recorded poses with another profile or model.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/instructor/model/stored/stored_gesture.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// Profile and model of a re-run. Both empty: as recorded.
struct RerunChoice {
  std::string profile_json;  ///< replaces the session's profile
  std::string axial_model;   ///< replaces that profile's model, by name: "DIRECT"
};

/// One run of the engine over the recorded poses. The trainee did not feel these forces and would have moved
/// differently with them; a screen that shows this result must say so.
struct Rerun {
  std::string what;  ///< "shoulder-frail, DIRECT"
  SessionScene scene;
  GestureTrace trace;       ///< forces, wall, layer, phase … from this run; tip from the recording
  double peak_force_N = 0;  ///< before the gate
  double mean_force_in_tissue_N = 0;
  double felt_peak_N = 0, felt_mean_in_tissue_N = 0;  ///< from the recording, after the gate
  double mean_difference_N = 0;  ///< of |force|, this run minus recording, over ticks in tissue in either of
                                 ///< the two
  std::uint64_t ticks = 0;
  std::vector<std::string> sentences;  ///< peak and mean forces compared with the recorded ones
};

/// Gives the same result, bit for bit, as `needlelab-sim run` with the same poses and profile; recorded poses
/// are rounded to the session's resolution. The session's own profile keeps the session's shares of
/// stiffness; another profile has its full stiffness. `each` receives every tick's report. Thinned recordings
/// run at their own rate; `sentences` say so. Errors: kInvalidInput (profile, model, placement), kFailed
/// (`stop`).
Result<Rerun> rerunGesture(const StoredGesture& gesture, const RerunChoice& choice,
                           const ScenePreparer& prepare = {}, const std::function<bool()>& stop = {},
                           const std::function<void(const StepReport&)>& each = {});

}  // namespace needlelab

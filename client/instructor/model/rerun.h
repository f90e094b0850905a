/// "What would it have felt like": the engine on a recording's poses, with another profile or model.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/instructor/model/stored_gesture.h"
#include "common/base/result.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// The profile and model of a re-run. Both empty: as recorded.
struct RerunChoice {
  std::string profile_json;  ///< in place of the session's own profile
  std::string axial_model;   ///< in place of that profile's, by name: "DIRECT"
};

/// One run of the engine over the recorded poses. The recorded hand did not feel it: with other forces it
/// would have moved otherwise; a screen that shows the result has to say that.
struct Rerun {
  std::string what;  ///< "shoulder-frail, DIRECT"
  SessionScene scene;
  GestureTrace trace;       ///< forces, wall, layer, phase … of this run; the tip is the recording's
  double peak_force_N = 0;  ///< before the gate
  double mean_force_in_tissue_N = 0;
  double felt_peak_N = 0, felt_mean_in_tissue_N = 0;  ///< as recorded, after the gate
  double mean_difference_N = 0;  ///< of |force|, this less recorded, over the ticks in tissue of either
  std::uint64_t ticks = 0;
  std::vector<std::string> sentences;  ///< peak and mean forces beside the recorded ones
};

/// Bit for bit what `needlelab-sim run` makes of the same poses and profile; recorded poses are rounded to
/// the session's resolution. `each`: sees every tick's report. Thinned recordings run at their own rate;
/// `sentences` say so. Errors: kInvalidInput (profile, model, placement), kFailed (`stop`).
Result<Rerun> rerunGesture(const StoredGesture& gesture, const RerunChoice& choice,
                           const ScenePreparer& prepare = {}, const std::function<bool()>& stop = {},
                           const std::function<void(const StepReport&)>& each = {});

}  // namespace needlelab

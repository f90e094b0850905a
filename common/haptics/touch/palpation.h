/// PALPATION: a capped needle feels the skin and the bones under it, and enters nothing (FORCE_MODEL.md,
/// "Palpation"). The capped tip is a ball. In ticks with the cap on, nothing else acts; in all others
/// palpation does nothing.
#pragma once

#include "common/haptics/engine.h"

namespace needlelab {

/// The radius of the capped tip. The scene lists PALPATION.
double capRadius_m(const SceneModel& scene) noexcept;

/// Puts the cap on or takes it off, in a tick before the step. Either waits until the ball is off the skin
/// and touches nothing, so neither changes a force; in the first tick of a state the cap goes on anywhere.
/// `around`: of a body, a piece about the tip; before there is one, it is not known to be off the skin.
/// Returns whether the cap is on. Real-time safe.
bool changeCap(const SceneModel& scene, const PlacedSurroundings& around, bool on, const TipSample& sample,
               SimState& state) noexcept;

/// Puts the cap on or takes it off wherever the tip is, for a reader whose stored tick says so. `clear`: the
/// ball has been off the skin. Real-time safe.
void setCap(bool on, bool clear, SimState& state) noexcept;

/// A tick with the cap on, instead of `step`. `scene`: in a body, its own model, not that of a path;
/// `around`: a piece of the body about the tip; without it the ball feels nothing. Real-time safe.
void palpate(const SceneModel& scene, const PlacedSurroundings& around, const TipSample& sample,
             SimState& state, StepReport& report) noexcept;

}  // namespace needlelab

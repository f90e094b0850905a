/// Simulated trainees: a level of skill sets what a hand is like, and nothing else.
#pragma once

#include <optional>

#include "client/device/hand.h"
#include "client/device/hand_plan.h"
#include "client/device/hand_tremor.h"

namespace needlelab {

/// What a level of skill decides. The two ends are set by hand, within what hands do; they are no measurement
/// of people.
struct HandSkill {
  double tremor_m = 0;     ///< peak per axis
  double speed_mps = 0;    ///< greatest, of insertion and withdrawal
  double aim_m = 0;        ///< spread of entry and of the point aimed at, across the way, per axis
  double overshoot_m = 0;  ///< mean way beyond the target before it is drawn back
  double pieces = 1;       ///< into how many movements the insertion breaks up: smoothness
};

/// `level`: 0 a beginner, 1 an expert; between them each quantity goes along a geometric row.
HandSkill skillOf(double level);

/// Where the profile's author marked the skin: the origin of the limb's frame, where it lies on the surface
/// (as in all of db/samples); nothing elsewhere.
std::optional<Vec3> markedEntry(const Limb& limb_W, const Pose& X_WL);

/// One attempt at `target_W_m` with this skill, by way of `entry_W_m` or, without one, the shortest way:
/// where it aims, how far it overshoots, where it hesitates are drawn from `random`; aspirates and injects at
/// the end, whatever the skill.
HandPlan attemptPlan(const HandSkill& skill, const Limb& limb_W, Vec3 target_W_m, HandRandom& random,
                     std::optional<Vec3> entry_W_m = std::nullopt);

/// The hand that pursues such a plan.
HandOptions handOf(const HandSkill& skill, std::uint64_t seed);

}  // namespace needlelab

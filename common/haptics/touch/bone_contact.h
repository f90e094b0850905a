/// The contact of a tip with bone, for any surface of bone. BONE, a stage: a stiff contact with the outermost
/// layer of bone, which no needle enters (FORCE_MODEL.md, "Bone"). The rendered needle (the proxy) stays on
/// the bone's surface, joined to the measured tip by a spring with the bone's stiffness (proxy_contact.h).
/// Meanwhile the tissue acts on the tip as if it had stayed where it met the bone, so that its springs do not
/// add to the bone's. Near the skin the spring shortens with the depth, so that it is gone when the tip comes
/// out.
///
/// Energy: as of any proxy. The tissue's force along u acts on the hand over a distance h that the tissue
/// does not feel; h begins and ends at 0, and while it is not 0 this force only falls and never pulls in, so
/// ∫ f dh ≤ 0.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/clamping.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/puncture.h"
#include "common/haptics/touch/proxy_contact.h"

namespace needlelab::bone_contact {

using namespace proxy_contact;

inline constexpr std::size_t kBoneOwn = stageOf(Effect::kBone);
/// Maximum steps for testing a tick's path; a cut through a round bone's edge shorter than a step may be
/// missed.
inline constexpr int kMaxSteps = 64;
/// The tissue feels the tip at no less than a tenth of its depth, so that it stays in the tissue.
inline constexpr double kMaxHeld = 0.9;
inline constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// A surface of bone is made from the scene's model and u, and besides what a proxy's surface has
// (proxy_contact.h) it has
//   bool meets(from, to, at&) const;              whether the tip's way meets the bone, and where
// and where it is not convex
//   bool isClear(bone, from, to) const;           whether a ball without bone, found before, has the way
//   void findClear(tip, bone&) const;             finds one

inline double frictionOf(const SceneModel& model) {
  return model.stage_numbers[kBoneOwn][kBoneFriction];
}

// √(1 + μ²): at the edge of the friction cone, the ratio of the spring's length to its pressed depth
inline double coneLength(const SceneModel& model) {
  const double friction = frictionOf(model);
  return std::sqrt(1.0 + friction * friction);
}

// Near the skin, and past the middle of a round bone, limits the spring's length so that its force ends where
// the tip leaves the limb. On a bone parallel to a flat skin, the limit is never reached
inline void bindToSkin(const SceneModel& model, Vec3 tip_W_m, double depth_m, double max_change_m,
                       BoneContact& bone) {
  const double max_m = coneLength(model) * depth_m;
  const Vec3 stretch = bone.p_proxy_W_m - tip_W_m;
  const double stretch_m = norm(stretch);
  if (!(stretch_m > max_m)) return;
  const Vec3 move = stretch * (max_m / stretch_m - 1.0);
  const double share = shareWithin(stretch - bone.stretch_W_m, move, max_change_m);
  bone.p_proxy_W_m = bone.p_proxy_W_m + move * share;
}

// removes the limits on the force with which the tissue holds the needle
inline void forgetTissue(BoneContact& bone) {
  bone.cutting_N = bone.friction_N = bone.place_m = kNoLimit;
}

// where the needle first rests on the bone: on its surface. If the tip is already in the bone, its last
// contact ended near the skin, and the bone holds it from there
template <class Surface>
Vec3 firstProxy(const Surface& bone, Vec3 from_W_m, Vec3 at_W_m, Vec3 way) {
  if (bone.depth(from_W_m) > kOnSurface_m) return from_W_m;
  return onto(bone, at_W_m, way);
}

// updates the contact for this tick's tip, which is `depth_m` under the skin. `from_W_m`: the last tip; used
// when it did not touch the bone
template <class Surface>
void updateContact(const SceneModel& model, Vec3 u_W, Vec3 from_W_m, Vec3 tip_W_m, double depth_m,
                   BoneContact& bone) {
  const Surface surface{model, u_W};
  const double friction = frictionOf(model);
  if (bone.touching) {
    const Vec3 before_W_m = bone.p_proxy_W_m - bone.stretch_W_m;
    const double max_change_m = mostChange(friction, model.period_s, norm(tip_W_m - before_W_m));
    bindToSkin(model, tip_W_m, depth_m, max_change_m, bone);
    bone.touching = followTip(surface, friction, tip_W_m, max_change_m, bone);
  } else {
    Vec3 at_W_m;
    if constexpr (!Surface::kIsConvex)
      if (surface.isClear(bone, from_W_m, tip_W_m)) return;
    if (!surface.meets(from_W_m, tip_W_m, at_W_m)) {
      if constexpr (!Surface::kIsConvex) surface.findClear(tip_W_m, bone);
      return;
    }
    bone.p_proxy_W_m = firstProxy(surface, from_W_m, at_W_m, tip_W_m - from_W_m);
    forgetTissue(bone);
    const double max_change_m = mostChange(friction, model.period_s, norm(tip_W_m - from_W_m));
    bone.touching = followTip(surface, friction, tip_W_m, max_change_m, bone);
  }
  if (bone.touching)
    bone.stretch_W_m = bone.p_proxy_W_m - tip_W_m;
  else
    bone = {};
}

// The tissue feels the tip no deeper along u than the proxy, unless a wall whose force pulls in is ahead of
// the proxy: the tip must pass it first. The tip stays in the tissue.
template <class Surface>
TipSample holdTip(const SceneModel& model, const TipSample& sample, SimState& state) noexcept {
  assert(model.isLive(Effect::kBone) && model.bone_layer > 0 && model.bone_layer < model.layer_count);
  TipSample felt = sample;
  if (!isFinite(sample)) return felt;
  const double depth_m = depthIn(model, sample.p_WT_m);
  BoneContact& bone = state.bone;
  if (!state.inside || !(depth_m > 0.0)) {
    bone = {};
    return felt;
  }
  updateContact<Surface>(model, state.u_W, state.p_prev_W_m, sample.p_WT_m, depth_m, bone);
  if (!bone.touching) return felt;
  const double tip_m = dot(state.u_W, sample.p_WT_m - state.p_entry_W_m);
  const double proxy_m = dot(state.u_W, bone.p_proxy_W_m - state.p_entry_W_m);
  double felt_m = std::max(proxy_m, state.wall_m);
  // models with a membrane on every top drag friction's wall themselves
  if (model.isLive(Effect::kShaftFriction) || axialEntry(model.axial_model).topOf != nullptr)
    felt_m = std::max(felt_m, state.friction_wall_m);
  bone.held_m = std::clamp(tip_m - felt_m, 0.0, kMaxHeld * depth_m);
  assert(!(bone.held_m > depth_m) && "the felt tip stays in the tissue");
  felt.p_WT_m = sample.p_WT_m - state.u_W * bone.held_m;
  return felt;
}

// limits the force of the wall at `wall_m` to `max_N` by moving the wall; returns the change along u
inline double limitWall(double stiffness_N_per_m, double x_cut_m, double& max_N, double& wall_m,
                        double& force_N) {
  assert(stiffness_N_per_m > 0.0 && max_N >= 0.0);
  const double before_N = force_N;
  if (-force_N > max_N) {
    force_N = -max_N;
    wall_m = x_cut_m - max_N / stiffness_N_per_m;
  }
  max_N = std::max(0.0, -force_N);
  return force_N - before_N;
}

// keeps intact membranes from stretching further than in the last tick: they move along, together with the
// walls that they hold back; returns the change of the force along u
inline double limitMembranes(const SceneModel& model, double x_m, SimState& state, StepReport& report) {
  const double gone_m = x_m - state.x_shift_m - state.bone.place_m;
  state.bone.place_m = x_m - state.x_shift_m;
  if (!(gone_m > 0.0)) return 0.0;
  const double x_cut_before_m = cuttingPosition(state, x_m);
  for (std::uint32_t left = intactMembranes(state); left != 0; left &= left - 1) {
    double& membrane_m = state.membrane_place_m[static_cast<std::size_t>(std::countr_zero(left))];
    membrane_m += std::clamp(x_m - membrane_m, 0.0, gone_m);
  }
  const double follow_m = cuttingPosition(state, x_m) - x_cut_before_m;
  state.wall_m += follow_m;
  state.friction_wall_m += follow_m;
  const double before_N = report.puncture_N;
  report.puncture_N = membranesForce(model, state, x_m);
  return report.puncture_N - before_N;
}

// where a membrane gave way in this tick the walls followed, with their pull: it ends, so that no wall ahead
// of the proxy ends the hold at once; returns the change of the force along u
inline double endPulls(const SceneModel& model, double x_m, SimState& state, StepReport& report) {
  if ((report.flags & kFlagRupture) == 0) return 0.0;
  const double x_cut_m = cuttingPosition(state, x_m);
  double pull_N = report.attracted_N;
  report.attracted_N = 0.0;
  state.wall_m = std::min(state.wall_m, x_cut_m);
  if (model.isLive(Effect::kShaftFriction) && report.friction_N > 0.0) {
    pull_N += report.friction_N;
    report.friction_N = 0.0;
    state.friction_wall_m = x_cut_m;
  }
  return -pull_N;
}

// lets the tissue's force on a needle that rests on bone only fall; returns the change of the force along u
inline double limitTissue(const SceneModel& model, const TipSample& felt, SimState& state,
                          StepReport& report) {
  BoneContact& bone = state.bone;
  if (!(bone.held_m > 0.0)) {
    forgetTissue(bone);
    return 0.0;
  }
  const double x_m = dot(state.u_W, felt.p_WT_m - state.p_entry_W_m);
  double along_N = endPulls(model, x_m, state, report);
  if (model.isLive(Effect::kPuncture)) along_N += limitMembranes(model, x_m, state, report);
  const double x_cut_m = cuttingPosition(state, x_m);
  if (model.cut_reach != nullptr && model.isLive(Effect::kCutting))
    along_N += limitWall(model.layers[state.layer].wall_stiffness_N_per_m, x_cut_m, bone.cutting_N,
                         state.wall_m, report.cutting_N);
  // "no wall" stays "no wall"
  if (!std::isnan(report.p_wall_W_m.x)) report.p_wall_W_m = state.p_entry_W_m + state.u_W * state.wall_m;
  if (model.isLive(Effect::kShaftFriction))
    along_N += limitWall(model.friction_stiffness_N_per_m, x_cut_m, bone.friction_N, state.friction_wall_m,
                         report.friction_N);
  return along_N;
}

// What clamping pushes out along u and what bone does are not a sum: of their parts along the bone's force
// the greater counts. While the needle stands on bone, the former would work though nothing of it is
// stretched; returns the change of the force.
inline Vec3 limitClamping(const SceneModel& model, const TipSample& felt, SimState& state,
                          const StepReport& report, Vec3 bone_W_N) {
  const double bone_N = report.stage_N[kBoneOwn], e_m = report.lateral_error_m;
  if (!model.isLive(Effect::kClamping) || !(report.insertion_m > 0.0) || !(bone_N > 0.0)) return {};
  const LateralStiffness of = lateralStiffness(state.along, report.insertion_m);
  if (!(of.k_N_per_m * e_m > 0.0)) return {};
  const double stretch_m = std::min(e_m, model.fixture.max_force_N / of.k_N_per_m);
  const double x_m = dot(state.u_W, felt.p_WT_m - state.p_entry_W_m);
  const double out_N =
      model.fixture_push * of.slope_N_per_m2 * stretch_m * stretch_m * x_m / report.insertion_m;
  const Vec3 normal = bone_W_N * (1.0 / bone_N);
  return normal * -std::clamp(-dot(state.u_W, normal) * out_N, 0.0, bone_N);
}

template <class Surface>
Vec3 pressBone(const SceneModel& model, const TipSample& felt, SimState& state, StepReport& report) noexcept {
  assert(state.inside);
  BoneContact& bone = state.bone;
  // an insertion has no u before its first tick, so the tissue feels this tip where it is
  if ((report.flags & kFlagEntry) != 0)
    updateContact<Surface>(model, state.u_W, state.p_entry_W_m, felt.p_WT_m, report.depth_m, bone);
  // the needle is either on the bone or in the tissue, even if its depth says otherwise
  const auto layer = static_cast<std::int32_t>(model.bone_layer);
  report.layer = bone.touching ? layer : std::min(report.layer, layer - 1);
  if (!bone.touching) return {};
  const double tissue_N = limitTissue(model, felt, state, report);
  const Vec3 force_W_N = bone.stretch_W_m * model.stage_numbers[kBoneOwn][kBoneStiffness_N_per_m];
  report.stage_N[kBoneOwn] = norm(force_W_N);
  return force_W_N + state.u_W * tissue_N + limitClamping(model, felt, state, report, force_W_N);
}

}  // namespace needlelab::bone_contact

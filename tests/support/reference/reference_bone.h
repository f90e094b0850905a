/// BONE's independent judge: a slow, literal transcription of FORCE_MODEL.md, "Bone", written from the text
/// alone. It is given what the tissue remembers.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab::test {

/// A fault planted in the transcription, like `Defect` of reference_engine.h.
enum class BoneDefect : std::uint8_t {
  kNone,
  kSticks,         ///< no friction cone: the proxy never slips
  kSlipsToFoot,    ///< a slipping proxy goes below the tip, not to the cone's edge
  kBeginsAtTip,    ///< contact begins at the tip's place on the bone, not where its path meets it
  kOneSlip,        ///< on a round bone the proxy slips once per tick
  kTipInBone,      ///< the tissue feels the measured tip
  kNoRoom,         ///< the stretch may change without limit in a tick
  kNarrowRoom,     ///< a tick's room ignores friction
  kSkinForgotten,  ///< the skin does not shorten the stretch
  kSkinAtBegin,    ///< … and also shortens it in the tick that begins the contact
  kStaysOut,       ///< a proxy outside the bone does not return to its surface
  kEndsAtOnce,     ///< contact ends when the tip is outside, whatever stretch is left
  kNotHeldToSkin,  ///< the restraint of the tissue has no limit near the skin
  kMembranesGrow,  ///< while h > 0 membranes are stretched further
  kCuttingGrows,   ///< while h > 0 the cutting force grows
  kFrictionGrows,  ///< while h > 0 the friction grows
};

/// What the tissue remembers from the previous tick; in an entry's tick only `p_entry_W_m` counts.
struct BoneTissue {
  bool entry = false;
  Vec3 p_entry_W_m;  ///< P0
  Vec3 u_W;
  double wall = 0;           ///< w; along u, in m
  double friction_wall = 0;  ///< w_f
};

/// The forces with which the tissue of a tick that felt the tip at p − u·h pushes out, before BONE lowers
/// them. Places and forces along u; a force that pushes out is positive.
struct BonePushes {
  double x_m = 0;         ///< of the place it feels
  double turned_m = 0;    ///< how far this tick's turn moved all remembered x
  bool ruptured = false;  ///< in this tick
  double wall_m = 0, wall_N_per_m = 0;
  double friction_wall_m = 0, friction_N_per_m = 0;
  struct Membrane {
    double place_m, k1_N_per_m, k2_N_per_m2;
  };
  std::vector<Membrane> membranes;  ///< intact, and met
  // as returned by `ReferenceBone::onlyFall`
  double cutting_N = 0, friction_N = 0, puncture_N = 0;
};

class ReferenceBone {
 public:
  /// The scene must have a layer of bone, and the effect must be live.
  ReferenceBone(SceneSpec scene, double rate_hz, BoneDefect planted = BoneDefect::kNone);

  struct Stand {
    bool touching = false;
    Vec3 p_proxy_W_m;         ///< q
    Vec3 force_W_N;           ///< K_b·s
    double held_m = 0;        ///< h
    Vec3 p_felt_W_m;          ///< p − u·h
    double felt_depth_m = 0;  ///< its δ
    // what the tick did, for the counts
    bool skin = false, back = false, cut = false, stayed = false;
  };
  /// One tick of a tip at `p_W_m`. `tissue`: absent if the tip is outside.
  Stand step(Vec3 p_W_m, const std::optional<BoneTissue>& tissue);
  /// Step 5's second part, after a `step` with h > 0.
  BonePushes onlyFall(BonePushes now);

 private:
  [[nodiscard]] double depthInLimb(Vec3 p_W_m) const;
  [[nodiscard]] double belowPlane(Vec3 p_W_m) const;
  [[nodiscard]] double depthInBone(Vec3 p_W_m) const;
  [[nodiscard]] Vec3 normalAt(Vec3 p_W_m) const;
  [[nodiscard]] Vec3 ontoBone(Vec3 p_W_m) const;
  [[nodiscard]] std::optional<Vec3> meeting(Vec3 from_W_m, Vec3 to_W_m) const;
  [[nodiscard]] double stretchAtSkin(Vec3 p_W_m) const;
  [[nodiscard]] double heldBack(Vec3 p_W_m, const BoneTissue& tissue) const;
  bool contactBegins(Vec3 p_W_m);
  [[nodiscard]] double shareInRoom(Vec3 move_W_m, Vec3 p_W_m) const;
  bool moveBy(Vec3 move_W_m, Vec3 p_W_m);
  void skin(Vec3 p_W_m);
  void back(Vec3 p_W_m);
  void slip(Vec3 p_W_m);
  bool slipOnce(Vec3 p_W_m, bool last_look);

  SceneSpec scene_;
  double period_s_;
  BoneDefect planted_;
  double stiffness_N_per_m_, friction_;
  double top_m_ = 0;  ///< of the outermost layer of bone

  std::optional<Vec3> p_before_W_m_;  ///< p'
  std::optional<Vec3> p_proxy_W_m_;   ///< q
  Vec3 stretch_before_W_m_;           ///< s'
  double room_m_ = 0;                 ///< M
  Stand stand_;
  std::optional<BonePushes> pushes_before_;  ///< of the last tick, if it had h > 0
};

}  // namespace needlelab::test

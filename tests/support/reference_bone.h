/// BONE's independent judge: a slow, literal transcription of FORCE_MODEL.md, "Bone", rules 1 to 3 and the
/// tip of rule 4, written from the text alone. It is told what the tissue remembers.
#pragma once

#include <cstdint>
#include <optional>

#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab::test {

/// A fault put into the transcription on purpose, as `Defect` of reference_engine.h.
enum class BoneDefect : std::uint8_t {
  kNone,
  kSticks,       ///< no friction's cone: the proxy never slips
  kSlipsToFoot,  ///< a proxy that slips goes below the tip, not to the cone's edge
  kBeginsAtTip,  ///< contact begins at the tip's place on the bone, not where the way meets it
  kOneSlip,      ///< on a round bone the proxy slips once a tick
  kTipInBone,    ///< the tissue feels the measured tip
};

/// What the tissue remembers of the tick before; in an entry's tick only `p_entry_W_m` counts.
struct BoneTissue {
  bool entry = false;
  Vec3 p_entry_W_m;  ///< P0
  Vec3 u_W;
  double wall = 0;           ///< w; along u, in m
  double friction_wall = 0;  ///< w_f
};

class ReferenceBone {
 public:
  /// The scene has a layer of bone; the effect is live.
  explicit ReferenceBone(SceneSpec scene, BoneDefect planted = BoneDefect::kNone);

  struct Stand {
    bool touching = false;
    Vec3 p_proxy_W_m;   ///< q
    Vec3 force_W_N;     ///< K_b·(q − p)
    double held_m = 0;  ///< h
    Vec3 p_felt_W_m;    ///< p − u·h
  };
  /// One tick of a tip at `p_W_m`. `tissue`: absent where the tip is outside.
  Stand step(Vec3 p_W_m, const std::optional<BoneTissue>& tissue);

 private:
  [[nodiscard]] double depthInLimb(Vec3 p_W_m) const;
  [[nodiscard]] double belowPlane(Vec3 p_W_m) const;
  [[nodiscard]] double depthInBone(Vec3 p_W_m) const;
  [[nodiscard]] Vec3 normalAt(Vec3 p_W_m) const;
  [[nodiscard]] Vec3 ontoBone(Vec3 p_W_m) const;
  [[nodiscard]] std::optional<Vec3> meeting(Vec3 from_W_m, Vec3 to_W_m) const;
  void contact(Vec3 p_W_m);
  void slip(Vec3 p_W_m);

  SceneSpec scene_;
  BoneDefect planted_;
  double stiffness_N_per_m_, friction_;
  double top_m_ = 0;  ///< of the outermost layer of bone
  std::optional<Vec3> p_before_W_m_;
  std::optional<Vec3> p_proxy_W_m_;
};

}  // namespace needlelab::test

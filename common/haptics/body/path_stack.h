/// The path of a needle in a body: the skin as a plane, the layers below it, the bones near the tip. The
/// engine steps on one path at a time (body_engine.h); another thread compiles the next one (FORCE_MODEL.md,
/// "A body").
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "common/haptics/body.h"
#include "common/haptics/scene_model.h"

namespace needlelab {

/// A path as plain values, in W. Depths are along the normal, below the plane.
struct PathLayers {
  Vec3 point_W_m;  ///< on the skin …
  Vec3 normal_W;   ///< … with its unit normal out of the body
  /// From the skin inwards, tops ascending from 0. The last may be kOutside: the needle has come out of the
  /// body.
  std::array<LayerStack::Layer, kMaxStackLayers> layers{};
  std::uint32_t count = 0;
  BonesNear bones;
  /// Down to here it is the path before; infinite if it is the same, 0 for the first of an insertion.
  double changes_from_m = 0;
};

/// Whether two paths differ by less than a hand can feel: the same structures, tops and bones within 20 µm.
bool alike(const PathLayers& a, const PathLayers& b) noexcept;

/// Instead of a structure in PathStack::reported: the bone that the needle rests on.
inline constexpr std::int8_t kTouchedBone = -1;

/// A path ready for the tick.
struct PathStack {
  PathLayers path;
  SceneModel model;  ///< layer i is path.layers[i]; with BONE, one of bone follows the last
  /// The structure to report for each layer of the model; beyond the body that of the skin.
  std::array<std::int8_t, kMaxLayers> reported{};
};

/// What the engine asks for a path with. All in W.
struct PathAsk {
  std::uint64_t tick = 0;  ///< of the engine, in which it asks
  /// 0: the needle is outside, and the path begins at the skin nearest to `p_tip_W_m`. Otherwise the number
  /// of the insertion, whose path stays as it is down to `keep_m`.
  std::uint64_t insertion = 0;
  Vec3 p_tip_W_m;      ///< where the tip is expected when the path is used
  Vec3 axis_W;         ///< outside: the needle's axis; inside: u
  Vec3 p_entry_W_m;    ///< inside: P0
  double slant = 1;    ///< inside: c
  double depth_m = 0;  ///< inside: δ of the tip
  double keep_m = 0;
  /// Inside: the path in use. It lives, unchanged, until the question is answered (PathMaker::retire).
  const PathLayers* now = nullptr;
};

/// Finds a path in the scene's body. False where the body has no skin near the tip, or no tissue below it.
/// `body`: a model compiled of a scene with a BodyLimb. Does not allocate; thread: any.
bool findPath(const SceneModel& body, const PathAsk& ask, PathLayers& path) noexcept;

/// Compiles a path. Null if the layers make no valid scene. Thread: any but the haptic thread.
std::unique_ptr<PathStack> compilePath(const SceneModel& body, const PathLayers& path);

}  // namespace needlelab

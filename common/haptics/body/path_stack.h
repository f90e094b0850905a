/// The path of a needle in a body: the skin as a plane, the layers below it, the bones near. The
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
  /// From the skin inwards, tops ascending from 0, those of bones among them. The last may be kOutside: the
  /// needle has come out of the body.
  std::array<LayerStack::Layer, kMaxStackLayers> layers{};
  std::uint32_t count = 0;
  /// The tip will be in this ball for some time.
  Vec3 ball_W_m;
  double ball_radius_m = 0;
  /// Inside: how deep the tip was when the path was asked for; 0 outside.
  double asked_depth_m = 0;
};

/// Instead of a structure in PathStack::reported: the bone that the needle rests on.
inline constexpr std::int8_t kTouchedBone = -1;

/// A path ready for the tick.
struct PathStack {
  PathLayers path;
  SceneModel model;  ///< its layers are those of the path; with BONE live, bones count as the tissue before
                     ///< them, and a layer of bone follows the last, where no needle comes
  /// The structure to report for each layer of the model; beyond the body that of the skin.
  std::array<std::int8_t, kMaxLayers> reported{};
};

/// Whether two paths differ by less than a hand can feel: the same structures, tops and skin within 50 µm,
/// and where there are bones the ball of `b` at most half of a's radius away from it.
bool alike(const PathStack& a, const PathStack& b) noexcept;

/// What the engine asks for a path with. All in W.
struct PathAsk {
  std::uint64_t tick = 0;  ///< of the engine, in which it asks
  /// 0: the needle is outside, and the path begins at the skin nearest to `p_tip_W_m`. Otherwise the number
  /// of the insertion, and the path follows its line.
  std::uint64_t insertion = 0;
  /// With the cap on: the path is a piece of the body about `p_tip_W_m`, and about the ball on the skin
  /// nearest to `point_W_m`, where it is expected; it has one layer.
  bool capped = false;
  Vec3 p_tip_W_m;            ///< where the tip is expected when the path is used
  double ball_radius_m = 0;  ///< how far around that bones are asked often
  Vec3 axis_W;               ///< outside: the needle's axis; inside: u
  Vec3 p_entry_W_m;          ///< inside: P0 …
  Vec3 point_W_m, normal_W;  ///< … and the plane of the skin that the path keeps
  double slant = 1;          ///< inside: c
  double depth_m = 0;        ///< inside: δ of the tip …
  double aside_m = 0;        ///< … and by how much that is more than the depth of the line there
};

/// Finds a path in the scene's body. False where the body has no skin near the tip, or no tissue below it.
/// `body`: a model compiled of a scene with a BodyLimb. Does not allocate; thread: any.
bool findPath(const SceneModel& body, const PathAsk& ask, PathLayers& path) noexcept;

/// Compiles a path. Null if the layers make no valid scene. Thread: any but the haptic thread.
std::unique_ptr<PathStack> compilePath(const SceneModel& body, const PathLayers& path);

}  // namespace needlelab

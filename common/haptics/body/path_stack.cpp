#include "common/haptics/body/path_stack.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <variant>

#include "common/haptics/axial_entry.h"
#include "common/haptics/body/bone_planes.h"
#include "common/haptics/effects/trajectory.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

/// A sliver is thinner than half the needle's diameter; of a needle without one, than this.
constexpr double kSliver_m = 0.35e-3;
/// How far a path goes beyond the needle's length, in needles: the skin gives way under a hub.
constexpr double kReach = 1.1;
/// Bones nearer to the tip than this are planes.
constexpr double kNear_m = 0.010;
/// A needle enters the first tissue below the skin at this depth.
constexpr double kFirst_m = 2e-4;
constexpr double kAlike_m = 2e-5, kAlikeCosine = 1 - 5e-7;
constexpr double kEndless_m = 1.0;

double sliver_m(const SceneSpec& spec) {
  return spec.needle_diameter_m > 0 ? 0.5 * spec.needle_diameter_m : kSliver_m;
}

/// A body in W.
struct Placed {
  const BodyLimb& limb;
  const Body& body;
  Pose X_WL, X_LW;

  [[nodiscard]] LayerStack layers(Vec3 from_W_m, Vec3 axis_W, double reach_m, double min_m) const noexcept {
    return body.layersAlong(X_LW * from_W_m, rotate(X_LW.q, axis_W), reach_m, min_m);
  }
  [[nodiscard]] Vec3 normal(Vec3 p_W_m) const noexcept { return rotate(X_WL.q, body.normal(X_LW * p_W_m)); }
  [[nodiscard]] StructureIndex structure(Vec3 p_W_m) const noexcept { return body.structureAt(X_LW * p_W_m); }
  [[nodiscard]] BonesNear bones(Vec3 p_W_m, double within_m) const noexcept {
    return bonesNear(limb, p_W_m, within_m);
  }
};

/// Adds a layer; one that begins within a sliver of the last takes its place, unless the last must stay.
void add(PathLayers& path, StructureIndex structure, double top_m, double min_m, std::uint32_t stay) {
  if (path.count > stay && top_m - path.layers[path.count - 1].top_m < min_m) {
    path.layers[path.count - 1].structure = structure;
    if (path.count > 1 && path.layers[path.count - 2].structure == structure) --path.count;
    return;
  }
  if (path.count > 0 && path.layers[path.count - 1].structure == structure) return;
  if (path.count == kMaxStackLayers) return;
  path.layers[path.count++] = {structure, top_m};
}

/// Adds the layers of a march that began at `from_m` along the needle, behind those that the path has. They
/// begin below `keep_m`.
void addMarched(const LayerStack& marched, double from_m, double slant, double keep_m, double min_m,
                PathLayers& path) {
  const std::uint32_t stay = path.count;
  StructureIndex here = marched.count > 0 ? marched.layers[0].structure : kOutside;
  std::size_t next = 1;
  const auto top = [&](std::size_t i) { return (from_m + marched.layers[i].top_m) * slant; };
  for (; next < marched.count && top(next) <= keep_m; ++next) here = marched.layers[next].structure;
  const double exit_m = (from_m + marched.end_m) * slant;
  const bool is_out = marched.end == StackEnd::kExit && exit_m <= keep_m;
  add(path, is_out ? kOutside : here, keep_m, min_m, stay);
  for (; next < marched.count; ++next) add(path, marched.layers[next].structure, top(next), min_m, stay);
  if (marched.end == StackEnd::kExit && !is_out) add(path, kOutside, exit_m, min_m, stay);
}

/// The bones near the tip, and the one that the needle points at.
void findBones(const Placed& body, const PathAsk& ask, const LayerStack& marched, Vec3 from_W_m, Vec3 axis_W,
               PathLayers& path) {
  path.bones = body.bones(ask.p_tip_W_m, kNear_m);
  if (marched.end != StackEnd::kBone || marched.count == 0 || path.bones.count == kMaxBonePlanes) return;
  const StructureIndex ahead = marched.layers[marched.count - 1].structure;
  for (std::size_t i = 0; i < path.bones.count; ++i)
    if (path.bones.planes[i].structure == ahead) return;
  const BonesNear hit = body.bones(from_W_m + axis_W * marched.end_m, 1e-3);
  for (std::size_t i = 0; i < hit.count; ++i)
    if (hit.planes[i].structure == ahead) path.bones.planes[path.bones.count++] = hit.planes[i];
}

bool findOutside(const Placed& body, const PathAsk& ask, const SceneSpec& spec, PathLayers& path) {
  const Vec3 at_W_m = nearestSkin(spec.limb, ask.p_tip_W_m, ask.axis_W), normal_W = body.normal(at_W_m);
  if (normal_W == Vec3{} || !isFinite(normal_W) || !isFinite(at_W_m)) return false;
  path.point_W_m = at_W_m;
  path.normal_W = normal_W;
  const Vec3 axis_W = entryDirection(ask.axis_W, normal_W);
  const double slant = -dot(normal_W, axis_W), min_m = sliver_m(spec);
  const LayerStack marched = body.layers(at_W_m, axis_W, std::min(1.0, kReach * spec.needle_length_m), min_m);
  if (marched.count > 0) {
    addMarched(marched, 0, slant, 0, min_m, path);
  } else {
    const StructureIndex first = body.structure(at_W_m - normal_W * kFirst_m);
    if (first == kOutside) return false;
    add(path, first, 0, min_m, 0);
  }
  findBones(body, ask, marched, at_W_m, axis_W, path);
  return path.count > 0 && path.layers[0].top_m == 0;
}

bool findInside(const Placed& body, const PathAsk& ask, const SceneSpec& spec, PathLayers& path) {
  const PathLayers& now = *ask.now;
  path.point_W_m = now.point_W_m;
  path.normal_W = now.normal_W;
  while (path.count < now.count && now.layers[path.count].top_m <= ask.keep_m) {
    path.layers[path.count] = now.layers[path.count];
    ++path.count;
  }
  const std::uint32_t stay = path.count;
  if (stay == 0) return false;
  // from a sliver behind the tip on, so that the march has dropped no more than slivers where layers may
  // change
  const double min_m = sliver_m(spec);
  const double from_m = std::max(0.0, ask.depth_m / ask.slant - min_m);
  const Vec3 from_W_m = ask.p_entry_W_m + ask.axis_W * from_m;
  const double reach_m = std::max(min_m, std::min(1.0, kReach * spec.needle_length_m - from_m));
  const LayerStack marched = body.layers(from_W_m, ask.axis_W, reach_m, min_m);
  if (now.layers[stay - 1].structure != kOutside)
    addMarched(marched, from_m, ask.slant, ask.keep_m, min_m, path);
  findBones(body, ask, marched, from_W_m, ask.axis_W, path);

  path.changes_from_m = std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < std::max(path.count, now.count); ++i) {
    const bool both = i < path.count && i < now.count;
    if (both && path.layers[i] == now.layers[i]) continue;
    double from_here_m = std::numeric_limits<double>::infinity();
    if (i < path.count) from_here_m = std::min(from_here_m, path.layers[i].top_m);
    if (i < now.count) from_here_m = std::min(from_here_m, now.layers[i].top_m);
    path.changes_from_m = from_here_m;
    break;
  }
  return true;
}

/// The tissue on the far side of the body: none, with the skin's stiffness.
LayerSpec nothing(const LayerSpec& skin) {
  LayerSpec layer;
  layer.wall_stiffness_N_per_m = skin.wall_stiffness_N_per_m;
  return layer;
}

}  // namespace

bool alike(const PathLayers& a, const PathLayers& b) noexcept {
  if (a.count != b.count || a.bones.count != b.bones.count) return false;
  const auto near = [](double x, double y) { return std::fabs(x - y) <= kAlike_m; };
  const auto planes = [&](Vec3 p, Vec3 n, Vec3 q, Vec3 m) {
    return near(dot(n, q - p), 0) && dot(n, m) >= kAlikeCosine;
  };
  if (!planes(a.point_W_m, a.normal_W, b.point_W_m, b.normal_W)) return false;
  for (std::uint32_t i = 0; i < a.count; ++i)
    if (a.layers[i].structure != b.layers[i].structure || !near(a.layers[i].top_m, b.layers[i].top_m))
      return false;
  for (std::size_t i = 0; i < a.bones.count; ++i) {
    const BonePlane &from = a.bones.planes[i], &to = b.bones.planes[i];
    if (from.structure != to.structure || !planes(from.point_m, from.normal, to.point_m, to.normal))
      return false;
  }
  return true;
}

bool findPath(const SceneModel& body, const PathAsk& ask, PathLayers& path) noexcept {
  assert(body.body_spec != nullptr && "a scene with a body");
  const auto& limb = std::get<BodyLimb>(body.body_spec->limb);
  const Placed placed{limb, *limb.body, limb.X_WL, inverse(limb.X_WL)};
  path = {};
  const bool found = ask.insertion == 0 ? findOutside(placed, ask, *body.body_spec, path)
                                        : findInside(placed, ask, *body.body_spec, path);
  if (!body.isLive(Effect::kBone)) path.bones.count = 0;
  return found;
}

std::unique_ptr<PathStack> compilePath(const SceneModel& body, const PathLayers& path) {
  assert(body.body_spec != nullptr && path.count > 0);
  SceneSpec spec = *body.body_spec;
  const bool has_bone = body.isLive(Effect::kBone);
  const bool can_be_nothing = !axialEntry(spec.axial_model).section.inLayers();
  spec.limb = PlaneLimb{path.point_W_m, path.normal_W};
  spec.bone_normal.reset();
  spec.layers.clear();
  const LayerSpec* bone = nullptr;
  for (const LayerSpec& structure : body.body_spec->layers)
    if (structure.is_bone && bone == nullptr) bone = &structure;
  double bone_top_m = 0;
  auto made = std::make_unique<PathStack>();
  for (std::uint32_t i = 0; i < path.count; ++i) {
    const LayerStack::Layer& layer = path.layers[i];
    if (layer.structure == kOutside && !can_be_nothing) break;
    const LayerSpec& own = layer.structure == kOutside
                               ? nothing(body.body_spec->layers[path.layers[0].structure])
                               : body.body_spec->layers[layer.structure];
    // BONE's own layer follows the last
    if (has_bone && own.is_bone) {
      bone_top_m = layer.top_m;
      break;
    }
    if (!spec.layers.empty()) spec.layers.back().thickness_m = layer.top_m - path.layers[i - 1].top_m;
    spec.layers.push_back(own);
    spec.layers.back().thickness_m = kEndless_m;
  }
  if (spec.layers.empty()) return nullptr;
  if (has_bone) {
    const double last_m = path.layers[spec.layers.size() - 1].top_m;
    if (spec.layers.size() == kMaxLayers) spec.layers.pop_back();
    if (bone_top_m > last_m) spec.layers.back().thickness_m = bone_top_m - last_m;
    spec.layers.push_back(*bone);
    spec.layers.back().thickness_m = kEndless_m;
  }
  auto model = compile(spec, body.rate_hz);
  if (!model.ok()) return nullptr;
  made->path = path;
  made->model = std::move(*model);
  for (std::uint32_t i = 0; i < made->model.layer_count; ++i) {
    const StructureIndex structure = i < path.count ? path.layers[i].structure : kOutside;
    made->reported[i] =
        static_cast<std::int8_t>(structure == kOutside ? path.layers[0].structure : structure);
  }
  // a hole is one of a structure: another path may have other membranes
  for (std::uint32_t i = 0, layer = 0; i < made->model.membrane_count; ++i) {
    while (made->model.layers[layer].top_m < made->model.membranes[i].top_m) ++layer;
    made->model.membrane_ids[i] = static_cast<std::uint8_t>(made->reported[layer]);
  }
  // without bones near, BONE does not act, and the tissue goes on
  if (has_bone)
    made->reported[made->model.bone_layer] =
        path.bones.count > 0 ? kTouchedBone : made->reported[made->model.bone_layer - 1];
  if (has_bone) useBonePlanes(path.bones, made->model);
  return made;
}

}  // namespace needlelab

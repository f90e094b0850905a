#include "common/haptics/body/path_stack.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <variant>

#include "common/haptics/axial_entry.h"
#include "common/haptics/body/bones_in_body.h"
#include "common/haptics/effects/trajectory.h"
#include "common/haptics/surface.h"
#include "common/haptics/touch/palpation.h"

namespace needlelab {
namespace {

/// A sliver is thinner than half the needle's diameter; of a needle without one, than this.
constexpr double kSliver_m = 0.35e-3;
/// How far a path goes beyond the needle's length, in needles: the skin gives way under a hub.
constexpr double kReach = 1.1;
/// A needle enters the first tissue below the skin at this depth.
constexpr double kFirst_m = 2e-4;
/// An entry outside of the skin, beside which the plane lies, has its skin found in so many steps.
constexpr int kSkinSteps = 64;
constexpr double kSkinStep_m = 1e-4;
constexpr double kAlike_m = 5e-5, kAlikeCosine = 1 - 5e-7;
constexpr double kEndless_m = 1.0;

double sliver_m(const SceneSpec& spec) {
  return spec.needle_diameter_m > 0 ? 0.5 * spec.needle_diameter_m : kSliver_m;
}

/// A body in W.
struct Placed {
  const Body& body;
  Pose X_WL, X_LW;

  [[nodiscard]] LayerStack layers(Vec3 from_W_m, Vec3 axis_W, double reach_m, double min_m) const noexcept {
    return body.layersAlong(X_LW * from_W_m, rotate(X_LW.q, axis_W), reach_m, min_m, AtBone::kGoesOn);
  }
  [[nodiscard]] double depth(Vec3 p_W_m) const noexcept { return body.depth(X_LW * p_W_m); }
  [[nodiscard]] Vec3 normal(Vec3 p_W_m) const noexcept { return rotate(X_WL.q, body.normal(X_LW * p_W_m)); }
  [[nodiscard]] StructureIndex structure(Vec3 p_W_m) const noexcept { return body.structureAt(X_LW * p_W_m); }
};

/// The layers of a march that began at `from_m` along the needle, whose tip is `aside_m` deeper than its
/// line.
void takeLayers(const LayerStack& marched, double from_m, double slant, double aside_m, PathLayers& path) {
  const auto add = [&](StructureIndex structure, double along_m) {
    const double top_m = (from_m + along_m) * slant + aside_m;
    if (path.count == 0 || !(top_m > 0.0))
      path.layers[0] = {structure, 0.0}, path.count = 1;
    else if (path.count < kMaxStackLayers)
      path.layers[path.count++] = {structure, top_m};
  };
  for (std::size_t i = 0; i < marched.count; ++i) add(marched.layers[i].structure, marched.layers[i].top_m);
  if (marched.end == StackEnd::kExit && path.count > 0) add(kOutside, marched.end_m);
}

// The skin and the bones about a capped tip; the layers do not count.
bool findCapped(const Placed& body, const PathAsk& ask, const SceneSpec& spec, PathLayers& path) {
  path.point_W_m = nearestSkin(spec.limb, ask.point_W_m, ask.axis_W);
  path.normal_W = body.normal(path.point_W_m);
  if (path.normal_W == Vec3{} || !isFinite(path.normal_W) || !isFinite(path.point_W_m)) return false;
  StructureIndex tissue = 0;
  while (spec.layers[tissue].is_bone && tissue + 1u < spec.layers.size()) ++tissue;
  path.layers[path.count++] = {tissue, 0};
  return true;
}

bool findOutside(const Placed& body, const PathAsk& ask, const SceneSpec& spec, PathLayers& path) {
  const Vec3 at_W_m = nearestSkin(spec.limb, ask.p_tip_W_m, ask.axis_W), normal_W = body.normal(at_W_m);
  if (normal_W == Vec3{} || !isFinite(normal_W) || !isFinite(at_W_m)) return false;
  path.point_W_m = at_W_m;
  path.normal_W = normal_W;
  const Vec3 axis_W = entryDirection(ask.axis_W, normal_W);
  const double reach_m = std::min(1.0, kReach * spec.needle_length_m);
  takeLayers(body.layers(at_W_m, axis_W, reach_m, sliver_m(spec)), 0, -dot(normal_W, axis_W), 0, path);
  if (path.count > 0) return true;
  const StructureIndex first = body.structure(at_W_m - normal_W * kFirst_m);
  if (first == kOutside) return false;
  path.layers[path.count++] = {first, 0};
  return true;
}

bool findInside(const Placed& body, const PathAsk& ask, const SceneSpec& spec, PathLayers& path) {
  path.point_W_m = ask.point_W_m;
  path.normal_W = ask.normal_W;
  path.asked_depth_m = ask.depth_m;
  // the plane lies beside the skin where that is round: a march from outside is empty
  const double reach_m = std::min(1.0, kReach * spec.needle_length_m);
  double from_m = 0;
  for (int i = 0; i < kSkinSteps && from_m < reach_m; ++i) {
    const Vec3 from_W_m = ask.p_entry_W_m + ask.axis_W * from_m;
    takeLayers(body.layers(from_W_m, ask.axis_W, reach_m - from_m, sliver_m(spec)), from_m, ask.slant,
               ask.aside_m, path);
    if (path.count > 0) return path.layers[0].structure != kOutside;
    from_m += std::max(-body.depth(from_W_m) / kMostSteep, kSkinStep_m);
  }
  return false;
}

/// The tissue on the far side of the body: none, with the skin's stiffness.
LayerSpec nothing(const LayerSpec& skin) {
  LayerSpec layer;
  layer.wall_stiffness_N_per_m = skin.wall_stiffness_N_per_m;
  return layer;
}

}  // namespace

bool alike(const PathStack& one, const PathStack& other) noexcept {
  const PathLayers &a = one.path, &b = other.path;
  if (a.count != b.count) return false;
  const auto near = [](double x, double y) { return std::fabs(x - y) <= kAlike_m; };
  if (!near(dot(a.normal_W, b.point_W_m - a.point_W_m), 0) || dot(a.normal_W, b.normal_W) < kAlikeCosine)
    return false;
  const double most_m = 0.5 * a.ball_radius_m;
  if (one.model.bones.bones != nullptr && normSquared(a.ball_W_m - b.ball_W_m) > most_m * most_m)
    return false;
  for (std::uint32_t i = 0; i < a.count; ++i)
    if (a.layers[i].structure != b.layers[i].structure || !near(a.layers[i].top_m, b.layers[i].top_m))
      return false;
  return true;
}

bool findPath(const SceneModel& body, const PathAsk& ask, PathLayers& path) noexcept {
  assert(body.body_spec != nullptr && "a scene with a body");
  const auto& limb = std::get<BodyLimb>(body.body_spec->limb);
  const Placed placed{*limb.body, limb.X_WL, inverse(limb.X_WL)};
  path = {};
  path.ball_W_m = ask.p_tip_W_m;
  path.ball_radius_m = ask.ball_radius_m;
  const auto find = ask.capped ? findCapped : ask.insertion == 0 ? findOutside : findInside;
  return find(placed, ask, *body.body_spec, path);
}

std::unique_ptr<PathStack> compilePath(const SceneModel& body, const PathLayers& path) {
  assert(body.body_spec != nullptr && path.count > 0);
  SceneSpec spec = *body.body_spec;
  const bool has_bone = body.isLive(Effect::kBone);
  const bool can_be_nothing = !axialEntry(spec.axial_model).section.inLayers();
  spec.limb = PlaneLimb{path.point_W_m, path.normal_W};
  spec.bone_normal.reset();
  spec.layers.clear();
  auto made = std::make_unique<PathStack>();
  double top_m = 0;
  for (std::uint32_t i = 0; i < path.count; ++i) {
    const LayerStack::Layer& layer = path.layers[i];
    if (layer.structure == kOutside && !can_be_nothing) break;
    const LayerSpec& own = layer.structure == kOutside
                               ? nothing(body.body_spec->layers[path.layers[0].structure])
                               : body.body_spec->layers[layer.structure];
    const auto reported =
        static_cast<std::int8_t>(layer.structure == kOutside ? path.layers[0].structure : layer.structure);
    if (has_bone && own.is_bone) continue;  // no needle comes into it: the tissue before it continues
    if (!spec.layers.empty() && made->reported[spec.layers.size() - 1] == reported &&
        layer.structure != kOutside)
      continue;
    // BONE's own layer follows the last
    if (spec.layers.size() + (has_bone ? 1 : 0) == kMaxLayers) break;
    const double begins_m = spec.layers.empty() ? 0.0 : layer.top_m;
    if (!spec.layers.empty()) spec.layers.back().thickness_m = begins_m - top_m;
    top_m = begins_m;
    made->reported[spec.layers.size()] = reported;
    spec.layers.push_back(own);
    spec.layers.back().thickness_m = kEndless_m;
  }
  if (spec.layers.empty()) return nullptr;
  const std::size_t count = spec.layers.size();
  if (has_bone) {
    const auto& structures = body.body_spec->layers;
    spec.layers.push_back(*std::find_if(structures.begin(), structures.end(),
                                        [](const LayerSpec& structure) { return structure.is_bone; }));
    spec.layers.back().thickness_m = kEndless_m;
  }
  auto model = compile(spec, body.rate_hz, &body.fixture_steepness);
  if (!model.ok()) return nullptr;
  made->path = path;
  made->model = std::move(*model);
  made->model.in_body = true;
  // a hole is one of a structure: another path may have other membranes
  for (std::uint32_t i = 0, layer = 0; i < made->model.membrane_count; ++i) {
    while (made->model.layers[layer].top_m < made->model.membranes[i].top_m) ++layer;
    made->model.membrane_ids[i] =
        static_cast<std::uint8_t>(made->reported[std::min<std::size_t>(layer, count - 1)]);
  }
  if (has_bone) made->reported[count] = kTouchedBone;
  const auto& limb = std::get<BodyLimb>(body.body_spec->limb);
  const Pose X_LW = inverse(limb.X_WL);
  const Vec3 ball_L_m = X_LW * path.ball_W_m;
  if (has_bone) made->model.bones = {limb.body->bonesIn(ball_L_m, path.ball_radius_m), limb.X_WL, X_LW};
  if (body.isLive(Effect::kPalpation)) {
    const Vec3 rest_W_m = path.point_W_m + path.normal_W * capRadius_m(body);
    made->model.around = {limb.body->around(ball_L_m, path.ball_radius_m),
                          limb.body->around(X_LW * rest_W_m, path.ball_radius_m), limb.X_WL, X_LW};
  }
  if (has_bone) useBones(made->model);
  return made;
}

}  // namespace needlelab

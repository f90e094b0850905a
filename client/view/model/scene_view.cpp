#include "client/view/model/scene_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/core.h>

#include "client/view/model/body_view.h"
#include "client/view/model/gesture_replica.h"
#include "common/anatomy/field_body.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/structure_kinds.h"
#include "common/profile/volume.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/structure_region.h"

namespace needlelab {
namespace {

constexpr double kUsualDiameter_m = 0.0008;  // of a 21G needle
constexpr double kInPlane_m = 0.001;         // hazards nearer than this count as in the picture's plane
constexpr double kHalved_m = 0.008;          // opacity halves over this distance
constexpr double kRingExtents = 0.045;       // radius of the ring at a planned entry, as a fraction of the
                                             // scene's extent
constexpr int kRingCorners = 32;

std::vector<LayerView> layersOf(const pb::Profile& profile) {
  const std::vector<std::string> names = layerNames(profile);
  const std::vector<LayerKind> kinds = layerKinds(profile);
  const std::vector<std::uint32_t> colours = layerColours(profile);
  std::vector<LayerView> views;
  double top_m = 0;
  for (const pb::Layer* layer : profileLayers(profile)) {
    LayerView view;
    view.kind = kinds[views.size()].kind;
    view.colour = rgbOf(colours[views.size()]);
    view.name = names[views.size()];
    view.top_m = top_m;
    view.bottom_m = top_m += layer->thickness_m();  // 0 in a volume
    view.cutting_N = layer->cutting_force_n();
    view.has_membrane = layer->has_puncture();
    if (profile.has_volume()) {
      const auto& structure = profile.volume().structures(static_cast<int>(views.size()));
      if (structure.fibre().has_direction())
        view.fibre_L = normalized(needlelab::vectorOf(structure.fibre().direction()));
      if (structure.fibre().along_tube())
        if (auto tubes = tubeAxesOf(profile.volume(), structure))
          view.tubes = std::make_shared<const TubeAxes>(*std::move(tubes));
    }
    views.push_back(std::move(view));
  }
  return views;
}

// Returns a limb's maximum depth; infinite for a plane.
double reachOf(const Limb& limb) {
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) return sphere->radius_m;
  if (const auto* capsule = std::get_if<CapsuleLimb>(&limb)) return capsule->radius_m;
  return std::numeric_limits<double>::infinity();
}

Vec3 middleOf(const Limb& limb) {
  if (const auto* sphere = std::get_if<SphereLimb>(&limb)) return sphere->center_m;
  if (const auto* capsule = std::get_if<CapsuleLimb>(&limb)) return (capsule->a_m + capsule->b_m) * 0.5;
  // a volume has no middle: its own origin, which authors put where the needle goes in
  if (const auto* body = std::get_if<BodyLimb>(&limb)) return body->X_WL.p;
  return std::get<PlaneLimb>(limb).point_m;
}

/// From the focus to the first target; straight in without one, or where that would be along the skin.
Vec3 wayIn(const SceneView& view) {
  constexpr double kLeastInward = 0.2;
  if (view.targets.empty()) return -view.focus_normal_W;
  const Vec3 way = view.targets.front().center_W_m - view.focus_W_m;
  const double size = norm(way);
  const bool inward = size > 1e-6 && -dot(way, view.focus_normal_W) > kLeastInward * size;
  return inward ? way / size : -view.focus_normal_W;
}

}  // namespace

Result<SceneView> sceneViewOf(const pb::Profile& profile, const Pose& X_WL) {
  // the engine's own conversion checks the profile and places the limb
  ASSIGN_OR_RETURN(auto spec, sceneSpecOf(profile, X_WL));
  SceneView view;
  view.profile_id = profile.id();
  view.profile_name = profile.name();
  view.X_WL = {X_WL.p, normalized(X_WL.q)};
  view.limb_W = spec.limb;
  if (const auto* body = std::get_if<BodyLimb>(&view.limb_W))
    view.body = std::dynamic_pointer_cast<const FieldBody>(body->body);
  if (auto* plane = std::get_if<PlaneLimb>(&view.limb_W)) plane->normal = normalized(plane->normal);
  view.layers = layersOf(profile);
  if ((spec.effects & bitOf(Effect::kPalpation)) != 0) {
    view.cap_radius_m = spec.stage_numbers[stageOf(Effect::kPalpation)][kPalpationRadius_m];
    const auto& structures = profile.volume().structures();
    for (int i = 0; i < structures.size(); ++i)
      if (structures[i].id() == profile.palpation().landmark())
        view.landmark = profile.palpation().landmark_name().empty()
                            ? view.layers[static_cast<std::size_t>(i)].name
                            : profile.palpation().landmark_name();
  }
  // the last layer has no lower end: it fills a round limb
  if (const double reach_m = reachOf(view.limb_W); std::isfinite(reach_m))
    view.layers.back().bottom_m = std::max(view.layers.back().bottom_m, reach_m);
  view.needle = needleOf(profile.needle());
  view.max_force_N = spec.max_force_N;
  const pb::Directions& names = profile.directions();
  for (const auto& [way_L, words] : {std::pair{Vec3{1, 0, 0}, &names.plus_x()},
                                     {Vec3{-1, 0, 0}, &names.minus_x()},
                                     {Vec3{0, 1, 0}, &names.plus_y()},
                                     {Vec3{0, -1, 0}, &names.minus_y()},
                                     {Vec3{0, 0, 1}, &names.plus_z()},
                                     {Vec3{0, 0, -1}, &names.minus_z()}})
    if (!words->empty()) view.directions.push_back({rotate(view.X_WL.q, way_L), *words});

  // same region positions as for the score
  Anatomy anatomy = anatomyOf(profile, X_WL);
  view.layer_end_m = anatomy.layer_end_m;
  for (const Target& target : anatomy.targets) {
    const DepthSpan span = depthSpanOf(anatomy, target);
    const Vec3 center = target.ball.a_W_m, normal = surfaceNormal(view.limb_W, center, -zAxis(view.X_WL.q));
    const double up_m = depthBelowSkin(view.limb_W, center) - 0.5 * (span.top_m + span.bottom_m);
    view.targets.push_back({target.ball.name, center, target.ball.radius_m, center + up_m * normal, normal,
                            span.top_m, span.bottom_m});
    TargetView& made = view.targets.back();
    const auto& written = profile.targets(static_cast<int>(view.targets.size()) - 1);
    made.is_structure = target.ball.structure != nullptr;
    if (made.is_structure || !written.tissues().empty()) made.layers = 0;
    for (std::size_t i = 0; i < view.layers.size(); ++i)
      if (made.is_structure
              ? profile.volume().structures(static_cast<int>(i)).id() == written.structure()
              : std::ranges::find(written.tissues(), view.layers[i].name) != written.tissues().end())
        made.layers |= 1U << i;
  }
  for (std::size_t i = 0; i < anatomy.hazards.size(); ++i) {
    Region& region = anatomy.hazards[i];
    view.hazards.push_back({std::move(region.name),
                            hazardKindOf(profile, profile.hazards(static_cast<int>(i))), region.a_W_m,
                            region.b_W_m, region.radius_m, region.structure});
  }

  // Focus above the target; if a limb has no normal there (in its middle), the profile's z is up.
  const Vec3 from = view.targets.empty() ? middleOf(view.limb_W) : view.targets.front().center_W_m;
  view.focus_normal_W = surfaceNormal(view.limb_W, from, -zAxis(view.X_WL.q));
  const double below_m = depthBelowSkin(view.limb_W, from);
  view.focus_W_m = nearestSkin(view.limb_W, from, -zAxis(view.X_WL.q));
  const double target_m = view.targets.empty() ? 0 : below_m;
  view.extent_m = std::clamp(std::max(0.9 * view.needle.length_m, 1.5 * target_m), 0.01, 0.5);
  if (view.body) frameBody(view);
  view.way_W = wayIn(view);
  return view;
}

double depthAt(const SceneView& scene, Vec3 p_W_m) {
  return depthBelowSkin(scene.limb_W, p_W_m);
}

int layerAt(const SceneView& scene, double depth_m) {
  return layerAtDepth(scene.layer_end_m, depth_m);
}

int layerAt(const SceneView& scene, Vec3 p_W_m) {
  return layerAt(scene.limb_W, scene.layer_end_m, p_W_m);
}

const std::string& layerName(const SceneView& scene, int layer) {
  static const std::string kOutsideWord = "outside", kNone = "?";
  if (layer < 0) return kOutsideWord;
  if (static_cast<std::size_t>(layer) >= scene.layers.size()) return kNone;
  return scene.layers[static_cast<std::size_t>(layer)].name;
}

NeedleLine lineToTarget(const SceneView& scene) {
  return {scene.focus_W_m, scene.body ? scene.way_W : -scene.focus_normal_W};
}

bool isTarget(const SceneView& scene, int layer) {
  return std::ranges::any_of(scene.targets, [&](const TargetView& target) {
    return target.is_structure && ((target.layers >> layer) & 1U) != 0;
  });
}

TissuesOnLine tissuesOnLine(const SceneView& scene, const NeedleLine& line, double reach_m) {
  constexpr double kStep_m = 1e-4;
  TissuesOnLine way;
  const auto add = [&](int layer, double top_m, double bottom_m) {
    bottom_m = std::min(bottom_m, reach_m);
    if (layer < 0 || layer >= static_cast<int>(scene.layers.size()) || !(bottom_m > top_m)) return;
    if (!way.tissues.empty() && way.tissues.back().layer == layer && way.tissues.back().bottom_m == top_m)
      way.tissues.back().bottom_m = bottom_m;
    else
      way.tissues.push_back({layer, top_m, bottom_m});
  };
  if (line.path) {
    const auto& layers = line.path->layers;
    const std::size_t count = line.path->count;
    for (std::size_t i = 0; i < count; ++i)
      add(layers[i].structure == kOutside ? -1 : layers[i].structure, layers[i].top_m / line.slant,
          i + 1 < count ? layers[i + 1].top_m / line.slant : reach_m);
  } else if (scene.body) {
    const Pose X_LW = inverse(scene.X_WL);
    const Vec3 in_L_m = X_LW * (line.entry_W_m + line.u_W * kStep_m);  // the line begins on the skin
    const LayerStack met =
        scene.body->layersAlong(in_L_m, rotate(X_LW.q, line.u_W), reach_m, kStep_m, AtBone::kGoesOn);
    for (std::size_t i = 0; i < met.count; ++i)
      add(met.layers[i].structure, i == 0 ? 0.0 : kStep_m + met.layers[i].top_m,
          kStep_m + (i + 1 < met.count ? met.layers[i + 1].top_m : met.end_m));
  } else {
    for (int k = 0; k * kStep_m < reach_m; ++k)
      add(layerAt(scene, line.entry_W_m + line.u_W * ((k + 0.5) * kStep_m)), k * kStep_m, (k + 1) * kStep_m);
  }
  for (const TargetView& target : scene.targets) {
    const Vec3 to_center = target.center_W_m - line.entry_W_m;
    const double foot_m = dot(to_center, line.u_W), r_m = target.radius_m;
    const double half2_m2 = r_m * r_m - normSquared(to_center - line.u_W * foot_m);
    const double half_m =
        target.is_structure ? reach_m + std::fabs(foot_m) : std::sqrt(std::max(0.0, half2_m2));
    const std::size_t before = way.targets.size();
    for (const TissuesOnLine::Tissue& tissue : way.tissues) {
      const double top_m = std::max(tissue.top_m, foot_m - half_m),
                   bottom_m = std::min(tissue.bottom_m, foot_m + half_m);
      if (((target.layers >> tissue.layer) & 1U) == 0 || !(bottom_m > top_m)) continue;
      if (way.targets.size() > before && way.targets.back().bottom_m == top_m)
        way.targets.back().bottom_m = bottom_m;
      else
        way.targets.push_back({way.targets.size() == before ? target.name : "", top_m, bottom_m});
    }
    if (way.targets.size() == before)
      way.targets.push_back({target.name + ", beside the line", foot_m, foot_m});
  }
  return way;
}

double ladderDepth_m(const SceneView& scene, double insertion_m) {
  const NeedleLine line = lineToTarget(scene);
  const TissuesOnLine way = tissuesOnLine(scene, line, lineReach_m(scene, line.entry_W_m, line.u_W));
  double deepest = 0;
  for (const TissuesOnLine::Aim& aim : way.targets)
    if (!aim.name.empty()) deepest = std::max(deepest, aim.bottom_m);
  if (deepest > 0) return std::max(1.2 * deepest, 1.1 * insertion_m);
  const double layers = scene.body || scene.layers.empty() ? 0.05 : scene.layers.back().bottom_m;
  return std::max(1e-3, std::min(layers, scene.needle.length_m > 0 ? scene.needle.length_m : layers));
}

Vec3 openingOf(const SceneView& scene, Vec3 tip_W_m, Quat q_WT) {
  return tip_W_m - openingBehindTip_m(scene.needle) * normalized(zAxis(q_WT));
}

double drawnDiameter_m(const SceneView& scene) {
  return scene.needle.outer_diameter_m > 0 ? scene.needle.outer_diameter_m : kUsualDiameter_m;
}

double lineReach_m(const SceneView& scene, Vec3 entry_W_m, Vec3 direction_W) {
  double reach_m = scene.needle.length_m;
  for (const TargetView& target : scene.targets)
    reach_m = std::max(reach_m, 1.15 * dot(target.center_W_m - entry_W_m, direction_W));
  return reach_m;
}

PlanView planViewOf(const SceneView& scene, const PlannedLine& plan_W) {
  const double reach_m = lineReach_m(scene, plan_W.entry_m, plan_W.direction);
  PlanView view{plan_W.entry_m,
                plan_W.entry_m - plan_W.direction * (0.5 * scene.needle.length_m),
                plan_W.entry_m + plan_W.direction * reach_m,
                {}};
  const Vec3 normal = surfaceNormal(scene.limb_W, plan_W.entry_m, plan_W.direction);
  // any two directions perpendicular to the normal
  const Vec3 across = normalized(cross(normal, std::fabs(normal.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const Vec3 along = cross(normal, across);
  for (int i = 0; i < kRingCorners; ++i) {
    const double angle_rad = 2 * std::numbers::pi * i / kRingCorners;
    view.ring_W_m.push_back(plan_W.entry_m + (across * std::cos(angle_rad) + along * std::sin(angle_rad)) *
                                                 (kRingExtents * scene.extent_m));
  }
  return view;
}

std::optional<PlannedLine> planOn(const SceneView& scene, const pb::Exercise& exercise) {
  if (exercise.profile_id() != scene.profile_id) return std::nullopt;
  const auto line = plannedLineOf(exercise, scene.X_WL);
  return line ? std::optional(onSkin(*line, scene.limb_W).value_or(*line)) : std::nullopt;
}

std::optional<PlanView> planViewOf(const SceneView& scene, const pb::Exercise& exercise) {
  const auto plan_W = planOn(scene, exercise);
  return plan_W ? std::optional(planViewOf(scene, *plan_W)) : std::nullopt;
}

double distanceToHazard_m(const HazardView& hazard, Vec3 tip_W_m, Vec3 skin_W_m) {
  return distanceTo(Region{{}, hazard.a_W_m, hazard.b_W_m, hazard.radius_m, hazard.structure}, tip_W_m,
                    skin_W_m);
}

const HazardView* hazardAt(const SceneView& scene, Vec3 p_W_m) {
  const auto found = std::ranges::find_if(scene.hazards, [&](const HazardView& hazard) {
    return hazard.structure && hazard.structure->distance(p_W_m) < 0;
  });
  return found == scene.hazards.end() ? nullptr : &*found;
}

double offPlane_m(const HazardView& hazard, const PicturePlane& plane) {
  const double a_m = dot(hazard.a_W_m - plane.place_W_m, plane.to_viewer_W),
               b_m = dot(hazard.b_W_m - plane.place_W_m, plane.to_viewer_W);
  const double nearest_m = std::min(a_m, b_m) - hazard.radius_m,
               farthest_m = std::max(a_m, b_m) + hazard.radius_m;
  return nearest_m > 0 ? nearest_m : farthest_m < 0 ? farthest_m : 0;
}

double offPlaneOpacity(double off_plane_m) {
  return std::exp2(-std::max(0.0, std::fabs(off_plane_m) - kInPlane_m) / kHalved_m);
}

std::string hazardLabel(const HazardView& hazard, double off_plane_m) {
  if (!(std::fabs(off_plane_m) > kInPlane_m)) return hazard.name;
  return fmt::format("{}, {:.0f} mm {}", hazard.name, std::fabs(off_plane_m) * 1000,
                     off_plane_m > 0 ? "in front" : "behind");
}

AidSet::AidSet(const AidList& aids) {
  for (const int number : aids)
    if (pb::Exercise::Aid_IsValid(number) && number != pb::Exercise::AID_UNSPECIFIED)
      set(static_cast<pb::Exercise::Aid>(number), true);
}

AidList AidSet::list() const {
  AidList aids;
  for (int number = pb::Exercise::Aid_MIN; number <= pb::Exercise::Aid_MAX; ++number)
    if (pb::Exercise::Aid_IsValid(number) && has(static_cast<pb::Exercise::Aid>(number))) aids.Add(number);
  return aids;
}

AidSet usualAidSet() {
  return AidSet(usualAids());
}

AidSet allAidSet() {
  AidSet all;
  for (int number = pb::Exercise::Aid_MIN; number <= pb::Exercise::Aid_MAX; ++number)
    if (pb::Exercise::Aid_IsValid(number) && number != pb::Exercise::AID_UNSPECIFIED)
      all.set(static_cast<pb::Exercise::Aid>(number), true);
  return all;
}

std::string_view aidWord(pb::Exercise::Aid aid) {
  switch (aid) {
    case pb::Exercise::PHASE:
      return "phase of the insertion";
    case pb::Exercise::LAYER:
      return "current layer";
    case pb::Exercise::DEPTH:
      return "depth";
    case pb::Exercise::FORCE:
      return "force";
    case pb::Exercise::ULTRASOUND:
      return "ultrasound picture";
    case pb::Exercise::TISSUES:
      return "tissues, cut open";
    case pb::Exercise::ANATOMY:
      return "target and hazards";
    case pb::Exercise::GUIDES:
      return "insertion line and wall";
    case pb::Exercise::ARROWS:
      return "force arrows";
    case pb::Exercise::ALIGNMENT:
      return "alignment";
    case pb::Exercise::PLANNED_LINE:
      return "planned line";
    case pb::Exercise::ALARMS:
      return "alarms";
    case pb::Exercise::STEPS:
      return "next step";
    default:
      return "unknown aid";
  }
}

}  // namespace needlelab

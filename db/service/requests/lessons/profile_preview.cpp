// Previews a profile's force over depth, using the same engine as the simulator.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/base/range.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"
#include "common/haptics/surface.h"
#include "common/profile/layer_names.h"
#include "common/profile/planned_line.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/structure_kinds.h"
#include "common/profile/warnings.h"
#include "db/service/context/long_work.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/profile_section.h"

namespace needlelab::handlers {
namespace {

constexpr double kPreviewRate_hz = 1000;
constexpr double kPreviewLead_m = 0.005;  // start of the needle's path, outside the skin

struct PreviewEntry {
  Vec3 point_m, normal;  ///< `normal`: against the needle
};

/// The needle's entry: a point on the surface (the topmost one if the shape has one; in a volume the one
/// nearest to the origin of L) and its normal. In a volume the needle goes to the first target's point, if
/// that lies steeply enough under the skin.
PreviewEntry entryOf(const Limb& limb, const pb::Profile& profile) {
  const Vec3 up{0, 0, 1};
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return {plane->point_m, normalized(plane->normal)};
  if (const auto* sphere = std::get_if<SphereLimb>(&limb))
    return {sphere->center_m + sphere->radius_m * up, up};
  if (const auto* body = std::get_if<BodyLimb>(&limb)) {
    const Vec3 skin = nearestSkin(limb, body->X_WL.p, -up);
    const Vec3 normal = surfaceNormal(limb, skin, -up);
    if (profile.targets_size() == 0 || !profile.targets(0).has_center_m()) return {skin, normal};
    const Vec3 back = skin - body->X_WL * vectorOf(profile.targets(0).center_m());
    const bool steep = dot(back, normal) > std::sin(kMinPlanSlope_rad) * norm(back);
    return {skin, steep ? normalized(back) : normal};
  }
  const auto& capsule = std::get<CapsuleLimb>(limb);
  const Vec3 axis = normalized(capsule.b_m - capsule.a_m);
  const Vec3 across =
      std::fabs(dot(axis, up)) < 0.9 ? up - dot(axis, up) * axis : Vec3{1, 0, 0} - axis.x * axis;
  const Vec3 normal = normalized(across);
  return {0.5 * (capsule.a_m + capsule.b_m) + capsule.radius_m * normal, normal};
}

/// The rotation of +z (hub to tip) to `direction`.
Quat zTo(Vec3 direction) {
  const double w = 1 + direction.z;
  if (w < 1e-9) return Quat{1, 0, 0, 0};
  const Vec3 axis = cross({0, 0, 1}, direction);
  return normalized(Quat{axis.x, axis.y, axis.z, w});
}

Status checkPreview(const pb::PreviewProfile& call) {
  const auto within = [](const char* field, double value, double min, double max) -> Status {
    const NumberRange range{min, max, false, false};
    return value == 0 || range.contains(value) ? Status() : Status(outOfRange(field, value, range));
  };
  if (auto valid = within("to_depth_m", call.to_depth_m(), 0.001, 1); !valid) return valid;
  if (auto valid = within("points", call.points(), 2, 2000); !valid) return valid;
  return within("speed_m_s", call.speed_m_s(), 0.001, 0.5);
}

/// A layer that the needle meets.
struct MetLayer {
  std::size_t index = 0;  ///< in profileLayers
  double from_m = 0, to_m = 0;
};

/// The layers on the needle's way; a volume's structures may come more than once.
std::vector<MetLayer> layersMet(const SceneSpec& spec, const PreviewEntry& entry) {
  std::vector<MetLayer> met;
  if (const auto* body = std::get_if<BodyLimb>(&spec.limb)) {
    const LayerStack stack = body->body->layersAlong(
        inverse(body->X_WL) * entry.point_m, rotate(conjugate(body->X_WL.q), -entry.normal),
        spec.needle_length_m, 0.5 * spec.needle_diameter_m, AtBone::kEnds);
    for (std::size_t i = 0; i < stack.count; ++i)
      met.push_back({stack.layers[i].structure, stack.layers[i].top_m,
                     i + 1 < stack.count ? stack.layers[i + 1].top_m : stack.end_m});
    // bone, where a stack ends, goes on
    if (stack.end == StackEnd::kBone && !met.empty()) met.back().to_m = spec.needle_length_m;
    return met;
  }
  double top_m = 0;
  for (const LayerSpec& layer : spec.layers) {
    met.push_back({met.size(), top_m, top_m + layer.thickness_m});
    top_m += layer.thickness_m;
  }
  return met;
}

void addLayers(const pb::Profile& profile, const std::vector<MetLayer>& met, pb::ProfilePreview& preview) {
  const std::vector<std::string> names = layerNames(profile);
  const std::vector<const pb::Layer*> layers = profileLayers(profile);
  const std::vector<LayerKind> kinds = layerKinds(profile);
  double before_N = 0;
  for (const MetLayer& one : met) {
    const pb::Layer& layer = *layers[one.index];
    const double thickness_m = profile.has_volume() ? one.to_m - one.from_m : layer.thickness_m();
    auto* felt = preview.add_layers();
    felt->set_name(names[one.index]);
    felt->set_tissue(pb::Layer::Tissue_Name(kinds[one.index].tissue));
    felt->set_from_m(one.from_m);
    felt->set_to_m(one.to_m);
    felt->set_fidelity(fidelity(before_N, layer.cutting_force_n(),
                                profile.tracking_wall().stiffness_n_per_m(), thickness_m));
    before_N = layer.cutting_force_n();
  }
}

}  // namespace

Result<pb::Reply> previewProfile(const Context& context, const pb::PreviewProfile& call) {
  if (auto valid = checkPreview(call); !valid) return valid.error();
  const auto profile = parseProfile(call.json(), "profile");
  if (!profile) return profile.error();
  pb::Reply reply;
  auto* preview = reply.mutable_profile_preview();
  if (profile->has_volume()) {
    if (auto added = addSection(*profile, *preview->mutable_section()); !added) return added.error();
  }
  if (profile->axial_model() == pb::Profile::FEM)
    return Error{ErrorCode::kInvalidInput,
                 "axial_model: FEM takes too long for a preview; look at it with needlelab-sim run"};
  const auto spec = sceneSpecOf(*profile);
  if (!spec && profile->has_volume()) return reply;  // no forces, yet a picture
  if (!spec) return spec.error();
  const auto model = compile(*spec, kPreviewRate_hz);
  if (!model) return model.error();

  const PreviewEntry entry = entryOf(spec->limb, *profile);
  const std::vector<MetLayer> met = layersMet(*spec, entry);
  const double bottom_m = met.empty() ? spec->needle_length_m : met.back().to_m;
  const double deepest_m =
      std::min(call.to_depth_m() > 0 ? call.to_depth_m() : bottom_m, spec->needle_length_m);
  const double speed_mps = call.speed_m_s() > 0 ? call.speed_m_s() : 0.01;
  const std::uint32_t points = call.points() > 0 ? call.points() : 400;

  preview->set_max_force_n(profile->has_max_force_n() ? profile->max_force_n() : 10);
  addLayers(*profile, met, *preview);
  std::vector<std::pair<const EffectEntry*, pb::ForceCurve*>> curves;
  for (const EffectEntry* effect : effectsAsShown()) {
    if (!effect->along_u) continue;
    curves.emplace_back(effect, preview->add_by_effect());
    curves.back().second->set_effect(std::string(effect->name));
  }

  const Quat q_WT = zTo(-entry.normal);
  SceneEngine engine(*model);
  StepReport report;
  // a body's engine needs some ticks until it has found the needle's path
  const std::uint64_t waits =
      std::holds_alternative<BodyLimb>(spec->limb) ? 2 * pathTicks(kPreviewRate_hz) : 0;
  for (std::uint64_t tick = 0; tick < waits; ++tick)
    engine.step({entry.point_m + kPreviewLead_m * entry.normal, q_WT}, report);
  const double step_m = speed_mps / kPreviewRate_hz;
  const auto ticks = static_cast<std::int64_t>(std::ceil((kPreviewLead_m + deepest_m) / step_m));
  std::uint32_t taken = 0;
  for (std::int64_t tick = 0; tick <= ticks && taken < points; ++tick) {
    if (context.parts.long_work.cancelled.load(std::memory_order_relaxed))
      return Error{ErrorCode::kUnavailable, "the server ends"};
    const double depth_m = std::min(static_cast<double>(tick) * step_m - kPreviewLead_m, deepest_m);
    engine.step({entry.point_m - depth_m * entry.normal, q_WT}, report);
    // record the first tick at or after each point of an even grid
    if (depth_m < deepest_m * taken / (points - 1) - 1e-12) continue;
    ++taken;
    preview->add_depth_m(std::max(depth_m, 0.0));
    preview->add_total_n(dot(report.wrench_W.force_N, entry.normal));
    // u points into the tissue; forces against the needle are negative
    for (const auto& [effect, curve] : curves) curve->add_force_n(0.0 - effect->value(report));
  }
  return reply;
}

}  // namespace needlelab::handlers

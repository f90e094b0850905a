// Previews a profile's force over depth, using the same engine as the simulator.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/base/range.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"
#include "common/profile/layer_names.h"
#include "common/profile/profile.h"
#include "common/profile/rules.h"
#include "common/profile/scene_of_profile.h"
#include "db/service/context/long_work.h"
#include "db/service/requests/handlers.h"

namespace needlelab::handlers {
namespace {

constexpr double kPreviewRate_hz = 1000;
constexpr double kPreviewLead_m = 0.005;  // start of the needle's path, outside the skin

struct PreviewEntry {
  Vec3 point_m, normal;
};

/// The needle's entry: a point on the surface (the topmost one if the shape has one) and its normal.
PreviewEntry entryOf(const Limb& limb) {
  const Vec3 up{0, 0, 1};
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return {plane->point_m, normalized(plane->normal)};
  if (const auto* sphere = std::get_if<SphereLimb>(&limb))
    return {sphere->center_m + sphere->radius_m * up, up};
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

void addLayers(const pb::Profile& profile, pb::ProfilePreview& preview) {
  const std::vector<std::string> names = layerNames(profile);
  double top_m = 0, before_N = 0;
  for (const pb::Layer& layer : profile.layers()) {
    auto* felt = preview.add_layers();
    felt->set_name(names[static_cast<std::size_t>(preview.layers_size()) - 1]);
    felt->set_tissue(pb::Layer::Tissue_Name(layer.tissue()));
    felt->set_from_m(top_m);
    felt->set_to_m(top_m += layer.thickness_m());
    felt->set_fidelity(fidelity(before_N, layer.cutting_force_n(),
                                profile.tracking_wall().stiffness_n_per_m(), layer.thickness_m()));
    before_N = layer.cutting_force_n();
  }
}

}  // namespace

Result<pb::Reply> previewProfile(const Context& context, const pb::PreviewProfile& call) {
  if (auto valid = checkPreview(call); !valid) return valid.error();
  const auto profile = parseProfile(call.json(), "profile");
  if (!profile) return profile.error();
  if (profile->axial_model() == pb::Profile::FEM)
    return Error{ErrorCode::kInvalidInput,
                 "axial_model: FEM takes too long for a preview; look at it with needlelab-sim run"};
  const auto spec = sceneSpecOf(*profile);
  if (!spec) return spec.error();
  const auto model = compile(*spec, kPreviewRate_hz);
  if (!model) return model.error();

  double bottom_m = 0;
  for (const LayerSpec& layer : spec->layers) bottom_m += layer.thickness_m;
  const double deepest_m =
      std::min(call.to_depth_m() > 0 ? call.to_depth_m() : bottom_m, spec->needle_length_m);
  const double speed_mps = call.speed_m_s() > 0 ? call.speed_m_s() : 0.01;
  const std::uint32_t points = call.points() > 0 ? call.points() : 400;

  pb::Reply reply;
  auto* preview = reply.mutable_profile_preview();
  preview->set_max_force_n(profile->has_max_force_n() ? profile->max_force_n() : 10);
  addLayers(*profile, *preview);
  std::vector<std::pair<const EffectEntry*, pb::ForceCurve*>> curves;
  for (const EffectEntry* effect : effectsAsShown()) {
    if (!effect->along_u) continue;
    curves.emplace_back(effect, preview->add_by_effect());
    curves.back().second->set_effect(std::string(effect->name));
  }

  const PreviewEntry entry = entryOf(spec->limb);
  const Quat q_WT = zTo(-entry.normal);
  const auto state = std::make_unique<SimState>();
  StepReport report;
  const double step_m = speed_mps / kPreviewRate_hz;
  const auto ticks = static_cast<std::int64_t>(std::ceil((kPreviewLead_m + deepest_m) / step_m));
  std::uint32_t taken = 0;
  for (std::int64_t tick = 0; tick <= ticks && taken < points; ++tick) {
    if (context.parts.long_work.cancelled.load(std::memory_order_relaxed))
      return Error{ErrorCode::kUnavailable, "the server ends"};
    const double depth_m = std::min(static_cast<double>(tick) * step_m - kPreviewLead_m, deepest_m);
    step(*model, {entry.point_m - depth_m * entry.normal, q_WT}, *state, report);
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

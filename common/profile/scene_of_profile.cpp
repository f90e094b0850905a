#include "common/profile/scene_of_profile.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <string>

#include "common/base/range.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/strict_json.h"

namespace needlelab {
namespace {

Vec3 vectorOf(const pb::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

// effects are numbered one higher in messages than in the engine: 0 means "unspecified"
static_assert(pb::Profile::Effect_MIN == 0 && pb::Profile::Effect_MAX == kEffectCount);

Result<Limb> limbOf(const pb::Limb& limb) {
  switch (limb.shape_case()) {
    case pb::Limb::kPlane:
      return Limb(PlaneLimb{vectorOf(limb.plane().point_m()), vectorOf(limb.plane().normal())});
    case pb::Limb::kSphere:
      return Limb(SphereLimb{vectorOf(limb.sphere().center_m()), limb.sphere().radius_m()});
    case pb::Limb::kCapsule:
      return Limb(CapsuleLimb{vectorOf(limb.capsule().a_m()), vectorOf(limb.capsule().b_m()),
                              limb.capsule().radius_m()});
    case pb::Limb::SHAPE_NOT_SET:
      break;
  }
  return Error{ErrorCode::kInvalidInput, "limb: give exactly one of plane, sphere, capsule; found none"};
}

LayerSpec layerOf(const pb::Layer& layer) {
  LayerSpec spec;
  spec.thickness_m = layer.thickness_m();
  spec.cutting_force_N = layer.cutting_force_n();
  spec.attracted_force_N = layer.attracted_force_n();
  spec.rejection_force_N = layer.rejection_force_n();
  spec.lateral_stiffness_N_per_m2 = layer.lateral_stiffness_n_per_m2();
  spec.friction_N_per_m = layer.friction_n_per_m();
  spec.is_bone = layer.tissue() == pb::Layer::BONE;
  if (layer.has_wall_stiffness_n_per_m()) spec.wall_stiffness_N_per_m = layer.wall_stiffness_n_per_m();
  if (layer.has_puncture()) {
    spec.membrane = MembraneSpec{layer.puncture().linear_n_per_m(), layer.puncture().quadratic_n_per_m2(),
                                 layer.puncture().force_n()};
  }
  return spec;
}

TrackingWallSpec wallOf(const pb::TrackingWall& wall) {
  TrackingWallSpec spec;
  spec.stiffness_N_per_m = wall.stiffness_n_per_m();
  spec.stop_speed_mps = wall.stop_speed_m_s();
  spec.stop_dwell_s = wall.stop_dwell_s();
  spec.stop_duration_s = wall.stop_duration_s();
  spec.stop_mode = static_cast<StopMode>(wall.stop_mode());
  if (wall.has_relax_time_s()) spec.relax_time_s = wall.relax_time_s();
  if (wall.has_relax_residual()) spec.relax_residual = wall.relax_residual();
  return spec;
}
static_assert(static_cast<StopMode>(pb::TrackingWall::RAMP) == StopMode::kRamp);
static_assert(static_cast<StopMode>(pb::TrackingWall::EXPONENTIAL) == StopMode::kExponential);

/// Reads the numbers of an effect's section by the names in its entry.
void readSection(const EffectEntry& effect, const pb::Profile& profile, SceneSpec& spec) {
  const google::protobuf::Message* const section = sectionOf(effect, profile);
  if (section == nullptr) return;
  const auto& reflection = *section->GetReflection();
  const auto fieldOf = [&](std::string_view name) {
    const auto* field = section->GetDescriptor()->FindFieldByName(std::string(name));
    assert(field != nullptr && "an effect's entry names a field that profile.proto does not have");
    return field;
  };
  for (const EffectField& field : effect.fields)
    field.of(spec) = reflection.GetDouble(*section, fieldOf(field.name));
  if (!effect.choice.name.empty())
    effect.choice.set(spec, reflection.GetEnumValue(*section, fieldOf(effect.choice.name)));
}
static_assert(static_cast<ClampingMode>(pb::VirtualFixture::PROPORTIONAL) == ClampingMode::kProportional);
static_assert(static_cast<ClampingMode>(pb::VirtualFixture::CONSERVATIVE) == ClampingMode::kConservative);

/// A placement must be finite and its quaternion a unit quaternion within the tolerance of files.
Result<Pose> checkedPlacement(const Pose& X_WL) {
  const double length = std::sqrt(dot(X_WL.q, X_WL.q));
  if (!isFinite(X_WL.p)) return Error{ErrorCode::kInvalidInput, "placement: its position is not finite"};
  if (!(std::abs(length - 1) <= 1e-3)) {
    return Error{ErrorCode::kInvalidInput, "placement: its quaternion has length " + numberText(length) +
                                               ", it must be 1 within 0.001"};
  }
  return Pose{X_WL.p, normalized(X_WL.q)};
}

// ---- the axial model and its section ----

// models are numbered one higher in messages than in the engine: 0 means "unspecified"
constexpr AxialModel modelOf(pb::Profile::AxialModel model) {
  return model == pb::Profile::AXIAL_MODEL_UNSPECIFIED ? AxialModel::kEnhancedTrackingWall
                                                       : static_cast<AxialModel>(model - 1);
}
constexpr pb::Profile::AxialModel messageOf(AxialModel model) {
  return static_cast<pb::Profile::AxialModel>(static_cast<int>(model) + 1);
}
static_assert(messageOf(AxialModel::kEnhancedTrackingWall) == pb::Profile::ENHANCED_TRACKING_WALL);
static_assert(messageOf(AxialModel::kTrackingWall) == pb::Profile::TRACKING_WALL);
static_assert(messageOf(AxialModel::kDirect) == pb::Profile::DIRECT);
static_assert(messageOf(AxialModel::kVoigt) == pb::Profile::VOIGT);
static_assert(messageOf(AxialModel::kGodObject) == pb::Profile::GOD_OBJECT);
static_assert(messageOf(AxialModel::kFirstOrder) == pb::Profile::FIRST_ORDER);
static_assert(messageOf(AxialModel::kStatistical) == pb::Profile::STATISTICAL);
static_assert(messageOf(AxialModel::kPrecomputed) == pb::Profile::PRECOMPUTED);
static_assert(messageOf(AxialModel::kFem) == pb::Profile::FEM);
static_assert(messageOf(AxialModel::kOkamura) == pb::Profile::OKAMURA);
static_assert(messageOf(AxialModel::kDahl) == pb::Profile::DAHL);
static_assert(pb::Profile::AxialModel_MAX == kAxialModelCount);

constexpr std::array<std::string_view, 4> kMayBeSynthetic = {"mean_n", "sd_n", "correlation_length_m",
                                                             "factors"};

OkamuraSpec okamuraOf(const pb::Okamura& from) {
  OkamuraSpec to{from.linear_n_per_m(),
                 from.quadratic_n_per_m2(),
                 from.puncture_force_n(),
                 from.cutting_force_n(),
                 {},
                 {}};
  to.in.kinetic_N_per_m = from.kinetic_in_n_per_m();
  to.in.static_N_per_m = from.has_static_in_n_per_m() ? from.static_in_n_per_m() : from.kinetic_in_n_per_m();
  to.in.viscous_Ns_per_m2 = from.viscous_in_ns_per_m2();
  to.out.kinetic_N_per_m = from.kinetic_out_n_per_m();
  to.out.static_N_per_m =
      from.has_static_out_n_per_m() ? from.static_out_n_per_m() : from.kinetic_out_n_per_m();
  to.out.viscous_Ns_per_m2 = from.viscous_out_ns_per_m2();
  return to;
}

void putOkamura(const OkamuraSpec& from, pb::Okamura& to) {
  to.set_linear_n_per_m(from.linear_N_per_m);
  to.set_quadratic_n_per_m2(from.quadratic_N_per_m2);
  to.set_puncture_force_n(from.puncture_force_N);
  to.set_cutting_force_n(from.cutting_force_N);
  to.set_kinetic_in_n_per_m(from.in.kinetic_N_per_m);
  to.set_kinetic_out_n_per_m(from.out.kinetic_N_per_m);
  to.set_static_in_n_per_m(from.in.static_N_per_m);
  to.set_static_out_n_per_m(from.out.static_N_per_m);
  to.set_viscous_in_ns_per_m2(from.in.viscous_Ns_per_m2);
  to.set_viscous_out_ns_per_m2(from.out.viscous_Ns_per_m2);
}

StatisticalSpec statisticalOf(const pb::Statistical& from) {
  StatisticalSpec to;
  for (const auto& row : from.table()) to.table.push_back({row.depth_m(), row.mean_n(), row.sd_n()});
  if (from.has_correlation_length_m()) to.correlation_length_m = from.correlation_length_m();
  to.seed = from.seed();
  if (from.factors().has_mean()) to.mean_factor = from.factors().mean();
  if (from.factors().has_thickness()) to.thickness_factor = from.factors().thickness();
  return to;
}

static_assert(static_cast<int>(NeedleTip::kUnknown) == pb::Needle::TIP_UNSPECIFIED);
static_assert(static_cast<int>(NeedleTip::kHypodermic) == pb::Needle::HYPODERMIC);
static_assert(static_cast<int>(NeedleTip::kQuincke) == pb::Needle::QUINCKE);
static_assert(static_cast<int>(NeedleTip::kTuohy) == pb::Needle::TUOHY);
static_assert(static_cast<int>(NeedleTip::kPencilPoint) == pb::Needle::PENCIL_POINT);

/// Sets `spec.axial_model` and every model's section that the profile has; the others keep their defaults.
/// `spec.layers` must be filled already. Errors: kInvalidInput for a number without a model.
Status readModel(const pb::Profile& profile, SceneSpec& spec) {
  if (!pb::Profile::AxialModel_IsValid(profile.axial_model()))
    return fieldError("axial_model",
                      fmt::format("{} is not a known model", static_cast<int>(profile.axial_model())));
  spec.axial_model = modelOf(profile.axial_model());

  if (profile.direct().has_stiffness_n_per_m())
    spec.direct.stiffness_N_per_m = profile.direct().stiffness_n_per_m();
  if (profile.direct().has_step_at_layers()) spec.direct.step_at_layers = profile.direct().step_at_layers();
  if (profile.voigt().has_stiffness_n_per_m())
    spec.voigt.stiffness_N_per_m = profile.voigt().stiffness_n_per_m();
  if (profile.voigt().has_damping_ns_per_m())
    spec.voigt.damping_Ns_per_m = profile.voigt().damping_ns_per_m();
  if (profile.god_object().has_stiffness_n_per_m())
    spec.god_object.stiffness_N_per_m = profile.god_object().stiffness_n_per_m();
  if (profile.has_statistical()) spec.statistical = statisticalOf(profile.statistical());
  for (const auto& row : profile.precomputed().table())
    spec.precomputed.table.push_back({row.depth_m(), row.cutting_n(), row.attracted_n()});
  if (profile.has_fem()) {
    spec.fem.nodes = profile.fem().nodes();
    for (const auto& layer : profile.fem().layers())
      spec.fem.layers.push_back(
          {layer.young_pa(), layer.poisson(), layer.friction_n_per_m(), layer.cutting_n()});
  }
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    const pb::Layer& layer = profile.layers(static_cast<int>(i));
    if (layer.has_okamura()) spec.layers[i].okamura = okamuraOf(layer.okamura());
    if (!layer.has_first_order()) continue;
    const pb::FirstOrder& own = layer.first_order();
    spec.layers[i].first_order = FirstOrderSpec{own.stiffness_n_per_m(), own.puncture_force_n(),
                                                own.cutting_force_n(), own.friction_n_per_m()};
  }
  return {};
}

}  // namespace

Result<Limb> unitLimbOf(const pb::Limb& limb) {
  ASSIGN_OR_RETURN(Limb made, limbOf(limb));
  if (auto* const plane = std::get_if<PlaneLimb>(&made)) plane->normal = normalized(plane->normal);
  return made;
}

NeedleSpec needleOf(const pb::Needle& needle) {
  NeedleSpec spec;
  spec.length_m = needle.length_m();
  if (needle.has_outer_diameter_m())
    spec.outer_diameter_m = needle.outer_diameter_m();
  else if (needle.has_gauge())
    spec.outer_diameter_m = gaugeDiameter_m(needle.gauge());
  if (pb::Needle::Tip_IsValid(needle.tip())) spec.tip = static_cast<NeedleTip>(needle.tip());
  spec.bevel_angle_rad = needle.bevel_angle_rad();
  return spec;
}

const google::protobuf::Message* sectionOf(const EffectEntry& effect, const pb::Profile& profile) {
  if (effect.section.empty()) return nullptr;
  const auto* field = profile.GetDescriptor()->FindFieldByName(std::string(effect.section));
  assert(field != nullptr && "an effect's entry names a section that profile.proto does not have");
  const auto& reflection = *profile.GetReflection();
  return reflection.HasField(profile, field) ? &reflection.GetMessage(profile, field) : nullptr;
}

Result<SceneSpec> sceneSpecOf(const pb::Profile& profile, const Pose& X_WL) {
  ASSIGN_OR_RETURN(const Pose placement, checkedPlacement(X_WL));
  ASSIGN_OR_RETURN(const Limb limb, limbOf(profile.limb()));

  SceneSpec spec;
  spec.needle_length_m = profile.needle().length_m();
  spec.needle_diameter_m = needleOf(profile.needle()).outer_diameter_m;
  spec.limb = placed(limb, placement);
  for (const pb::Layer& layer : profile.layers()) spec.layers.push_back(layerOf(layer));
  RETURN_IF_ERROR(readModel(profile, spec));
  spec.tracking_wall = wallOf(profile.tracking_wall());
  for (const EffectEntry* effect : effectEntries()) readSection(*effect, profile, spec);
  if (profile.bone().has_normal()) spec.bone_normal = rotate(placement.q, vectorOf(profile.bone().normal()));
  if (profile.has_max_force_n()) spec.max_force_N = profile.max_force_n();
  for (const int effect : profile.effects()) {
    if (effect <= pb::Profile::Effect_MIN || effect > pb::Profile::Effect_MAX)
      return Error{ErrorCode::kInvalidInput, fmt::format("effects: {} is not a known effect", effect)};
    spec.effects |= bitOf(static_cast<Effect>(effect - 1));
  }
  RETURN_IF_ERROR(validate(spec));
  return spec;
}

Status checkModelSection(const pb::Profile& profile) {
  const auto model = profile.axial_model();
  const auto missing = [&](pb::Profile::AxialModel needs_it, bool present) {
    return model == needs_it && !present;
  };
  const std::string words = "is missing, and axial_model is " + pb::Profile::AxialModel_Name(model);
  if (missing(pb::Profile::DIRECT, profile.has_direct())) return fieldError("direct", words);
  if (missing(pb::Profile::VOIGT, profile.has_voigt())) return fieldError("voigt", words);
  if (missing(pb::Profile::GOD_OBJECT, profile.has_god_object())) return fieldError("god_object", words);
  if (missing(pb::Profile::STATISTICAL, profile.has_statistical())) return fieldError("statistical", words);
  if (missing(pb::Profile::PRECOMPUTED, profile.has_precomputed())) return fieldError("precomputed", words);
  if (missing(pb::Profile::FEM, profile.has_fem())) return fieldError("fem", words);
  for (int i = 0; i < profile.layers_size(); ++i) {
    if (missing(pb::Profile::FIRST_ORDER, profile.layers(i).has_first_order()))
      return fieldError(fmt::format("layers[{}].first_order", i), words);
    const bool has_okamura = profile.layers(i).has_okamura();
    if (missing(pb::Profile::OKAMURA, has_okamura) || missing(pb::Profile::DAHL, has_okamura))
      return fieldError(fmt::format("layers[{}].okamura", i), words);
  }

  for (int i = 0; i < profile.statistical().synthetic_size(); ++i) {
    const std::string& name = profile.statistical().synthetic(i);
    if (std::find(kMayBeSynthetic.begin(), kMayBeSynthetic.end(), name) == kMayBeSynthetic.end())
      return fieldError(fmt::format("statistical.synthetic[{}]", i),
                        quotedText(name) + " is not one of mean_n, sd_n, correlation_length_m, factors");
  }
  return {};
}

void putModel(const SceneSpec& spec, pb::Profile& profile) {
  profile.set_axial_model(messageOf(spec.axial_model));
  switch (spec.axial_model) {
    case AxialModel::kEnhancedTrackingWall:
    case AxialModel::kTrackingWall:
      break;
    case AxialModel::kDirect:
      profile.mutable_direct()->set_stiffness_n_per_m(spec.direct.stiffness_N_per_m);
      profile.mutable_direct()->set_step_at_layers(spec.direct.step_at_layers);
      break;
    case AxialModel::kVoigt:
      profile.mutable_voigt()->set_stiffness_n_per_m(spec.voigt.stiffness_N_per_m);
      profile.mutable_voigt()->set_damping_ns_per_m(spec.voigt.damping_Ns_per_m);
      break;
    case AxialModel::kGodObject:
      profile.mutable_god_object()->set_stiffness_n_per_m(spec.god_object.stiffness_N_per_m);
      break;
    case AxialModel::kFirstOrder:
      for (int i = 0; i < profile.layers_size(); ++i) {
        const auto& own = spec.layers.at(static_cast<std::size_t>(i)).first_order;
        if (!own) continue;
        pb::FirstOrder& to = *profile.mutable_layers(i)->mutable_first_order();
        to.set_stiffness_n_per_m(own->stiffness_N_per_m);
        to.set_puncture_force_n(own->puncture_force_N);
        to.set_cutting_force_n(own->cutting_force_N);
        to.set_friction_n_per_m(own->friction_N_per_m);
      }
      break;
    case AxialModel::kOkamura:
    case AxialModel::kDahl:
      for (int i = 0; i < profile.layers_size(); ++i)
        if (const auto& own = spec.layers.at(static_cast<std::size_t>(i)).okamura)
          putOkamura(*own, *profile.mutable_layers(i)->mutable_okamura());
      break;
    case AxialModel::kStatistical: {
      pb::Statistical& to = *profile.mutable_statistical();
      to.clear_table();
      for (const auto& row : spec.statistical.table) {
        auto& one = *to.add_table();
        one.set_depth_m(row.depth_m);
        one.set_mean_n(row.mean_N);
        one.set_sd_n(row.sd_N);
      }
      to.set_correlation_length_m(spec.statistical.correlation_length_m);
      to.set_seed(static_cast<std::uint32_t>(spec.statistical.seed));
      to.mutable_factors()->set_mean(spec.statistical.mean_factor);
      to.mutable_factors()->set_thickness(spec.statistical.thickness_factor);
      break;
    }
    case AxialModel::kPrecomputed: {
      pb::Precomputed& to = *profile.mutable_precomputed();
      to.clear_table();
      for (const auto& row : spec.precomputed.table) {
        auto& one = *to.add_table();
        one.set_depth_m(row.depth_m);
        one.set_cutting_n(row.cutting_N);
        one.set_attracted_n(row.attracted_N);
      }
      break;
    }
    case AxialModel::kFem: {
      pb::Fem& to = *profile.mutable_fem();
      to.set_nodes(spec.fem.nodes);
      to.clear_layers();
      for (const FemLayerSpec& layer : spec.fem.layers) {
        auto& one = *to.add_layers();
        one.set_young_pa(layer.young_Pa);
        one.set_poisson(layer.poisson);
        one.set_friction_n_per_m(layer.friction_N_per_m);
        one.set_cutting_n(layer.cutting_N);
      }
      break;
    }
  }
  profile.clear_effects();
  for (std::size_t i = 0; i < kEffectCount; ++i)
    if ((spec.effects & bitOf(static_cast<Effect>(i))) != 0)
      profile.add_effects(static_cast<pb::Profile::Effect>(i + 1));
}

Status chooseModel(pb::Profile& profile, const std::string& name) {
  pb::Profile::AxialModel model{};
  if (!pb::Profile::AxialModel_Parse(name, &model) || model == pb::Profile::AXIAL_MODEL_UNSPECIFIED) {
    std::string known;
    for (const std::string_view one : kAxialModelNames)
      known += (known.empty() ? "" : ", ") + std::string(one);
    return Error{ErrorCode::kInvalidInput, "--model: '" + name + "' is unknown; there is: " + known};
  }
  profile.set_axial_model(model);
  // sections with defaults for every field
  if (model == pb::Profile::DIRECT) profile.mutable_direct();
  if (model == pb::Profile::VOIGT) profile.mutable_voigt();
  if (model == pb::Profile::GOD_OBJECT) profile.mutable_god_object();
  const Status status = checkModelSection(profile);
  if (status.ok()) return {};
  std::string help = "; add it to the profile";
  if (model == pb::Profile::PRECOMPUTED)
    help += ", or make one with: needlelab-sim precompute --profile P.json --mesh N --out Q.json";
  return Error{status.error().code, "--model " + name + ": " + status.error().message + help};
}

}  // namespace needlelab

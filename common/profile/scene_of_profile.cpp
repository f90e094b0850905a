#include "common/profile/scene_of_profile.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "common/anatomy/field_body.h"
#include "common/base/range.h"
#include "common/base/text/strict_json.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/layer_names.h"
#include "common/profile/structure_kinds.h"
#include "common/profile/volume.h"
#include "needlelab/options.pb.h"

namespace needlelab {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

/// What the scene of a volume has for the thickness of its structures.
constexpr double kNominalThickness_m = 0.01;

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

}  // namespace

LayerSpec layerOf(const pb::Layer& layer, pb::Layer::Tissue tissue) {
  LayerSpec spec;
  spec.thickness_m = layer.thickness_m();
  spec.cutting_force_N = layer.cutting_force_n();
  spec.attracted_force_N = layer.attracted_force_n();
  spec.rejection_force_N = layer.rejection_force_n();
  spec.lateral_stiffness_N_per_m2 = layer.lateral_stiffness_n_per_m2();
  spec.friction_N_per_m = layer.friction_n_per_m();
  spec.is_bone = tissue == pb::Layer::BONE;
  if (layer.has_wall_stiffness_n_per_m()) spec.wall_stiffness_N_per_m = layer.wall_stiffness_n_per_m();
  if (layer.has_puncture()) {
    spec.membrane = MembraneSpec{layer.puncture().linear_n_per_m(), layer.puncture().quadratic_n_per_m2(),
                                 layer.puncture().force_n()};
  }
  return spec;
}

namespace {

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

/// The field of a message that an effect's or a model's row names.
const FieldDescriptor* fieldOfRow(const Message& message, std::string_view name) {
  const auto* field = message.GetDescriptor()->FindFieldByName(std::string(name));
  assert(field != nullptr && "a row names a field that profile.proto does not have");
  return field;
}

/// The section with that name; null: `message` does not have it.
const Message* sectionNamed(const Message& message, std::string_view name) {
  const auto* field = fieldOfRow(message, name);
  const auto& reflection = *message.GetReflection();
  return reflection.HasField(message, field) ? &reflection.GetMessage(message, field) : nullptr;
}

/// Reads the numbers of an effect's section by the names in its entry.
void readSection(const EffectEntry& effect, const pb::Profile& profile, SceneSpec& spec) {
  const Message* const section = sectionOf(effect, profile);
  if (section == nullptr) return;
  const auto& reflection = *section->GetReflection();
  for (const EffectField& field : effect.fields)
    field.of(spec) = reflection.GetDouble(*section, fieldOfRow(*section, field.name));
  if (!effect.choice.name.empty())
    effect.choice.set(spec, reflection.GetEnumValue(*section, fieldOfRow(*section, effect.choice.name)));
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
static_assert(pb::Profile::AxialModel_MAX == kAxialModelCount);

static_assert(static_cast<int>(NeedleTip::kUnknown) == pb::Needle::TIP_UNSPECIFIED);
static_assert(static_cast<int>(NeedleTip::kHypodermic) == pb::Needle::HYPODERMIC);
static_assert(static_cast<int>(NeedleTip::kQuincke) == pb::Needle::QUINCKE);
static_assert(static_cast<int>(NeedleTip::kTuohy) == pb::Needle::TUOHY);
static_assert(static_cast<int>(NeedleTip::kPencilPoint) == pb::Needle::PENCIL_POINT);

/// Passes on the message and the field of a name like "factors.mean".
template <class Use>
void atField(const Message& message, std::string_view name, const Use& use) {
  const auto dot = name.find('.');
  const auto* field = fieldOfRow(message, name.substr(0, dot));
  if (dot == std::string_view::npos) return use(message, field);
  atField(message.GetReflection()->GetMessage(message, field), name.substr(dot + 1), use);
}
template <class Use>
void atField(Message& message, std::string_view name, const Use& use) {
  const auto dot = name.find('.');
  const auto* field = fieldOfRow(message, name.substr(0, dot));
  if (dot == std::string_view::npos) return use(message, field);
  atField(*message.GetReflection()->MutableMessage(&message, field), name.substr(dot + 1), use);
}

struct NumberReader {
  const Message& from;
  const FieldDescriptor* field;
  void operator()(double* to) const { *to = from.GetReflection()->GetDouble(from, field); }
  void operator()(bool* to) const { *to = from.GetReflection()->GetBool(from, field); }
  void operator()(std::int32_t* to) const { *to = from.GetReflection()->GetInt32(from, field); }
  void operator()(std::uint64_t* to) const { *to = from.GetReflection()->GetUInt32(from, field); }
};
struct NumberWriter {
  Message* to;
  const FieldDescriptor* field;
  void operator()(const double* from) const { to->GetReflection()->SetDouble(to, field, *from); }
  void operator()(const bool* from) const { to->GetReflection()->SetBool(to, field, *from); }
  void operator()(const std::int32_t* from) const { to->GetReflection()->SetInt32(to, field, *from); }
  void operator()(const std::uint64_t* from) const {
    to->GetReflection()->SetUInt32(to, field, static_cast<std::uint32_t>(*from));
  }
};

/// Numbers that the message does not have keep their value.
void readFields(std::span<const AxialField> fields, const Message& message, std::size_t i, SceneSpec& spec) {
  for (const AxialField& own : fields) {
    const auto read = [&](const Message& from, const FieldDescriptor* field) {
      if (from.GetReflection()->HasField(from, field)) std::visit(NumberReader{from, field}, own.of(spec, i));
    };
    if (!own.absent.empty()) atField(message, own.absent, read);
    atField(message, own.name, read);
  }
}

void putFields(std::span<const AxialField> fields, SceneSpec& spec, std::size_t i, Message& message) {
  for (const AxialField& own : fields)
    atField(message, own.name, [&](Message& to, const FieldDescriptor* field) {
      std::visit(NumberWriter{&to, field}, own.of(spec, i));
    });
}

/// Where such a section may stand: in each layer, or in the profile.
std::vector<const Message*> placesOf(const AxialSection& section, const pb::Profile& profile) {
  if (section.name.empty()) return {};
  if (!section.inLayers()) return {&profile};
  const auto layers = profileLayers(profile);
  return {layers.begin(), layers.end()};
}

/// Reads every model's section that the profile has; the others keep their defaults. `spec.layers` must be
/// filled already.
void readModelSections(const pb::Profile& profile, SceneSpec& spec) {
  for (const AxialEntry* model : axialEntries()) {
    const AxialSection& own = model->section;
    const std::vector<const Message*> places = placesOf(own, profile);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Message* const section = sectionNamed(*places[i], own.name);
      if (section == nullptr) continue;
      if (own.inLayers()) own.addTo(spec.layers[i]);
      readFields(own.fields, *section, i, spec);
      if (own.table.empty()) continue;
      const auto* table = fieldOfRow(*section, own.table);
      const auto& reflection = *section->GetReflection();
      const int rows = reflection.FieldSize(*section, table);
      own.resize(spec, static_cast<std::size_t>(rows));
      for (int row = 0; row < rows; ++row)
        readFields(own.row_fields, reflection.GetRepeatedMessage(*section, table, row),
                   static_cast<std::size_t>(row), spec);
    }
  }
}

/// Errors: kInvalidInput for a number without a model.
Status readModel(const pb::Profile& profile, SceneSpec& spec) {
  if (!pb::Profile::AxialModel_IsValid(profile.axial_model()))
    return fieldError("axial_model",
                      fmt::format("{} is not a known model", static_cast<int>(profile.axial_model())));
  spec.axial_model = modelOf(profile.axial_model());
  readModelSections(profile, spec);
  return {};
}

/// A volume's skin in its own frame.
Result<Limb> bodyOf(const pb::Volume& volume) {
  ASSIGN_OR_RETURN(Field field, fieldOf(volume));
  return Limb(BodyLimb{std::make_shared<const FieldBody>(std::move(field)), {}});
}

/// The engine names a scene's layers; an author knows a volume's structures.
Error inVolume(Error error) {
  std::string& words = error.message;
  constexpr std::string_view kLayer = "layers[";
  for (auto at = words.find(kLayer); at != std::string::npos; at = words.find(kLayer, at)) {
    const auto end = words.find(']', at);
    if (end == std::string::npos || end == at + kLayer.size()) {
      at += kLayer.size();
      continue;
    }
    const std::string to =
        "volume.structures[" + words.substr(at + kLayer.size(), end - at - kLayer.size()) + "].layer";
    words.replace(at, end + 1 - at, to);
    at += to.size();
  }
  return error;
}

bool anyIsRequired(const google::protobuf::Descriptor& message) {
  for (int i = 0; i < message.field_count(); ++i)
    if (message.field(i)->options().GetExtension(pb::required)) return true;
  return false;
}

}  // namespace

Result<Limb> unitLimbOf(const pb::Profile& profile) {
  if (profile.has_volume()) return bodyOf(profile.volume());
  ASSIGN_OR_RETURN(Limb made, limbOf(profile.limb()));
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

const Message* sectionOf(const EffectEntry& effect, const pb::Profile& profile) {
  return effect.section.empty() ? nullptr : sectionNamed(profile, effect.section);
}

const AxialEntry& axialEntryOf(const pb::Profile& profile) {
  return axialEntry(modelOf(profile.axial_model()));
}

pb::Profile::Effect numberOfEffect(Effect effect) {
  pb::Profile::Effect number = pb::Profile::EFFECT_UNSPECIFIED;
  const bool found = pb::Profile::Effect_Parse(std::string(effectName(effect)), &number);
  assert(found && "profile.proto does not have an effect of this name");
  static_cast<void>(found);
  return number;
}

Result<SceneSpec> sceneSpecOf(const pb::Profile& profile, const Pose& X_WL) {
  ASSIGN_OR_RETURN(const Pose placement, checkedPlacement(X_WL));
  ASSIGN_OR_RETURN(const Limb limb, profile.has_volume() ? bodyOf(profile.volume()) : limbOf(profile.limb()));

  SceneSpec spec;
  spec.needle_length_m = profile.needle().length_m();
  spec.needle_diameter_m = needleOf(profile.needle()).outer_diameter_m;
  spec.limb = placed(limb, placement);
  const std::vector<LayerKind> kinds = layerKinds(profile);
  for (const pb::Layer* layer : profileLayers(profile)) {
    spec.layers.push_back(layerOf(*layer, kinds[spec.layers.size()].tissue));
    if (profile.has_volume()) spec.layers.back().thickness_m = kNominalThickness_m;
  }
  RETURN_IF_ERROR(readModel(profile, spec));
  spec.tracking_wall = wallOf(profile.tracking_wall());
  for (const EffectEntry* effect : effectEntries()) readSection(*effect, profile, spec);
  if (profile.bone().has_normal()) spec.bone_normal = rotate(placement.q, vectorOf(profile.bone().normal()));
  if (profile.has_max_force_n()) spec.max_force_N = profile.max_force_n();
  for (const int effect : profile.effects()) {
    const auto rows = effectEntries();
    const auto row = std::find_if(rows.begin(), rows.end(), [effect](const EffectEntry* entry) {
      return numberOfEffect(entry->effect) == effect;
    });
    if (row == rows.end())
      return Error{ErrorCode::kInvalidInput, fmt::format("effects: {} is not a known effect", effect)};
    spec.effects |= bitOf((*row)->effect);
  }
  if (const Status valid = validate(spec); !valid.ok())
    return profile.has_volume() ? inVolume(valid.error()) : valid.error();
  return spec;
}

Status checkModelSection(const pb::Profile& profile) {
  const AxialSection& chosen = axialEntryOf(profile).section;
  const std::vector<const Message*> places = placesOf(chosen, profile);
  for (std::size_t i = 0; i < places.size(); ++i)
    if (sectionNamed(*places[i], chosen.name) == nullptr)
      return fieldError(
          (chosen.inLayers() ? layerPath(profile, i) + "." : "") + std::string(chosen.name),
          "is missing, and axial_model is " + pb::Profile::AxialModel_Name(profile.axial_model()));

  for (const AxialEntry* model : axialEntries()) {
    const AxialSection& own = model->section;
    if (own.may_be_synthetic.empty()) continue;
    const Message* const section = sectionNamed(profile, own.name);
    if (section == nullptr) continue;
    const auto* synthetic = fieldOfRow(*section, "synthetic");
    for (int i = 0; i < section->GetReflection()->FieldSize(*section, synthetic); ++i) {
      const std::string name = section->GetReflection()->GetRepeatedString(*section, synthetic, i);
      if (std::ranges::find(own.may_be_synthetic, name) == own.may_be_synthetic.end())
        return fieldError(
            fmt::format("{}.synthetic[{}]", own.name, i),
            fmt::format("{} is not one of {}", quotedText(name), fmt::join(own.may_be_synthetic, ", ")));
    }
  }
  return {};
}

void putModel(const SceneSpec& spec, pb::Profile& profile) {
  profile.set_axial_model(messageOf(spec.axial_model));
  const AxialSection& own = axialEntry(spec.axial_model).section;
  SceneSpec from = spec;  // the accessors take a scene that can be changed
  const std::vector<pb::Layer*> layers = own.inLayers() ? profileLayers(profile) : std::vector<pb::Layer*>();
  const std::size_t count = own.name.empty() ? 0 : own.inLayers() ? layers.size() : 1;
  for (std::size_t i = 0; i < count; ++i) {
    if (own.inLayers() && !own.isIn(from.layers.at(i))) continue;
    Message& of = own.inLayers() ? static_cast<Message&>(*layers[i]) : profile;
    Message* const section = of.GetReflection()->MutableMessage(&of, fieldOfRow(of, own.name));
    putFields(own.fields, from, i, *section);
    if (own.table.empty()) continue;
    const auto* table = fieldOfRow(*section, own.table);
    section->GetReflection()->ClearField(section, table);
    for (std::size_t row = 0; row < own.rows(from); ++row)
      putFields(own.row_fields, from, row, *section->GetReflection()->AddMessage(section, table));
  }
  profile.clear_effects();
  for (std::size_t i = 0; i < kEffectCount; ++i)
    if ((spec.effects & bitOf(static_cast<Effect>(i))) != 0)
      profile.add_effects(numberOfEffect(static_cast<Effect>(i)));
}

Status chooseModel(pb::Profile& profile, const std::string& name) {
  pb::Profile::AxialModel model{};
  if (!pb::Profile::AxialModel_Parse(name, &model) || model == pb::Profile::AXIAL_MODEL_UNSPECIFIED)
    return Error{ErrorCode::kInvalidInput, fmt::format("--model: '{}' is unknown; there is: {}", name,
                                                       fmt::join(kAxialModelNames, ", "))};
  profile.set_axial_model(model);
  const AxialSection& own = axialEntryOf(profile).section;
  if (!own.name.empty() && !own.inLayers()) {
    // a section with defaults for every field
    const auto* field = fieldOfRow(profile, own.name);
    if (!anyIsRequired(*field->message_type())) profile.GetReflection()->MutableMessage(&profile, field);
  }
  const Status status = checkModelSection(profile);
  if (status.ok()) return {};
  std::string help = "; add it to the profile";
  if (!own.made_by.empty()) help.append(", or make one with: ").append(own.made_by);
  return Error{status.error().code, "--model " + name + ": " + status.error().message + help};
}

}  // namespace needlelab

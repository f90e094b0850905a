#include "common/profile/volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>

#include "common/anatomy/tube_axes.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/profile/layer_names.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/structure_kinds.h"

namespace needlelab {
namespace {

constexpr double kMinLength = 1e-6;  // of a direction

FieldPart partOf(const pb::Volume::Part& part) {
  FieldPart made;
  made.blend_m = part.blend_m();
  switch (part.shape_case()) {
    case pb::Volume::Part::kCapsule: {
      const auto& capsule = part.capsule();
      made.shape = CapsulePart{vectorOf(capsule.a_m()), vectorOf(capsule.b_m()), capsule.radius_a_m(),
                               capsule.has_radius_b_m() ? capsule.radius_b_m() : capsule.radius_a_m()};
      break;
    }
    case pb::Volume::Part::kEllipsoid: {
      EllipsoidPart ellipsoid{vectorOf(part.ellipsoid().center_m()), vectorOf(part.ellipsoid().radii_m())};
      if (part.ellipsoid().has_x_axis()) ellipsoid.x_axis = vectorOf(part.ellipsoid().x_axis());
      if (part.ellipsoid().has_y_axis()) ellipsoid.y_axis = vectorOf(part.ellipsoid().y_axis());
      made.shape = ellipsoid;
      break;
    }
    case pb::Volume::Part::kHalfSpace:
      made.shape = HalfSpacePart{vectorOf(part.half_space().point_m()), vectorOf(part.half_space().normal())};
      break;
    case pb::Volume::Part::kTube: {
      TubePart tube;
      for (const auto& point : part.tube().points())
        tube.points.push_back({vectorOf(point.at_m()), point.radius_m()});
      made.shape = tube;
      break;
    }
    case pb::Volume::Part::SHAPE_NOT_SET:
      break;  // a capsule without a radius: refused by the check
  }
  return made;
}

FieldGroup groupOf(const pb::Volume::Group& group) {
  FieldGroup made{group.id(), {}};
  for (const auto& part : group.parts()) made.parts.push_back(partOf(part));
  return made;
}

template <class Bounds>
FieldRange rangeOf(const Bounds& bounds) {
  FieldRange range;
  range.group = bounds.group();
  if (bounds.has_from_m()) range.from_m = bounds.from_m();
  if (bounds.has_to_m()) range.to_m = bounds.to_m();
  return range;
}

/// Checks what a structure is: whether all agree that it is bone, and its fibres.
Status checkKind(const pb::Volume& volume, const pb::Volume::Structure& structure, const std::string& path) {
  if (const auto tissue = tissueOf(structure), follows = structureKind(structure.kind()).tissue;
      structure.has_kind() && (tissue == pb::Layer::BONE) != (follows == pb::Layer::BONE))
    return fieldError(path + "kind", fmt::format("{} contradicts layer.tissue, {}: bone is bone in both",
                                                 pb::Volume::Structure::Kind_Name(structure.kind()),
                                                 pb::Layer::Tissue_Name(tissue)));
  if (structure.fibre().has_direction() && norm(vectorOf(structure.fibre().direction())) < kMinLength)
    return fieldError(path + "fibre.direction", "has no direction: its length is 0");
  if (structure.fibre().along_tube() && !tubeAxesOf(volume, structure))
    return fieldError(path + "fibre.along_tube",
                      "needs a first rule whose group has tubes or capsules alone");
  return {};
}

}  // namespace

std::optional<TubeAxes> tubeAxesOf(const pb::Volume& volume, const pb::Volume::Structure& structure) {
  const auto rule = std::ranges::find(volume.rules(), structure.id(), &pb::Volume::Rule::structure);
  if (rule == volume.rules().end()) return std::nullopt;
  const auto group = std::ranges::find(volume.groups(), rule->group(), &pb::Volume::Group::id);
  return group == volume.groups().end() ? std::nullopt : TubeAxes::of(groupOf(*group));
}

FieldSpec fieldSpecOf(const pb::Volume& volume) {
  FieldSpec spec;
  for (const auto& group : volume.groups()) spec.groups.push_back(groupOf(group));
  for (const auto& structure : volume.structures()) {
    FieldStructure& made = spec.structures.emplace_back();
    made.id = structure.id();
    made.name = structure.layer().has_name() ? structure.layer().name() : structure.id();
    made.layer = layerOf(structure.layer(), tissueOf(structure));
  }
  for (const auto& rule : volume.rules()) {
    FieldRule& made = spec.rules.emplace_back();
    made.range = rangeOf(rule);
    for (const auto& clip : rule.clips()) made.clips.push_back(rangeOf(clip));
    made.structure = rule.structure();
  }
  spec.skin = volume.skin();
  spec.rest = volume.rest();
  return spec;
}

Status checkVolume(const pb::Volume& volume) {
  for (int i = 0; i < volume.structures_size(); ++i) {
    const pb::Layer& layer = volume.structures(i).layer();
    const std::string path = fmt::format("volume.structures[{}].layer.", i);
    if (layer.has_thickness_m())
      return fieldError(path + "thickness_m", "a structure has the thickness that its rules give it");
    if (layer.has_name()) RETURN_IF_ERROR(checkName(path + "name", layer.name()));
    RETURN_IF_ERROR(checkKind(volume, volume.structures(i), fmt::format("volume.structures[{}].", i)));
  }
  if (const Status status = checkField(fieldSpecOf(volume)); !status.ok())
    return Error{status.error().code, "volume." + status.error().message};
  return {};
}

Result<Field> fieldOf(const pb::Volume& volume) {
  RETURN_IF_ERROR(checkVolume(volume));
  return Field::make(fieldSpecOf(volume));
}

}  // namespace needlelab

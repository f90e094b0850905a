/// What the structures of a profile are: one row for each kind, with all that follows from it.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

/// How windows draw a structure of a body.
enum class StructureShape : std::uint8_t {
  kSoft,   ///< in the section only
  kBone,   ///< as a surface, together with the other bones
  kSolid,  ///< as a surface of its own: tendons, ligaments, bursae, discs
  kLine,   ///< a nerve or a vessel: as a surface that stays visible
};

struct StructureKind {
  pb::Volume::Structure::Kind kind;
  pb::Layer::Tissue tissue;  ///< of a structure whose layer has none
  pb::Hazard::Kind hazard;   ///< of a hazard that has no kind of its own
  std::string_view words;    ///< for people: "joint capsule"
  std::uint32_t colour;      ///< 0xRRGGBB
  StructureShape shape;
  float echo, grain;  ///< in ultrasound: 0 black to 1 white, and how much that varies
};

/// All rows, by number.
std::span<const StructureKind> structureKinds();
/// The row of a kind; OTHER's for KIND_UNSPECIFIED.
const StructureKind& structureKind(pb::Volume::Structure::Kind kind);
/// The kind of a layer: a tissue's own.
pb::Volume::Structure::Kind kindOf(pb::Layer::Tissue tissue);
/// A structure's kind; without one its tissue's.
pb::Volume::Structure::Kind kindOf(const pb::Volume::Structure& structure);
/// A structure's tissue; without one its kind's.
pb::Layer::Tissue tissueOf(const pb::Volume::Structure& structure);
/// A hazard's kind; without one that of its structure.
pb::Hazard::Kind hazardKindOf(const pb::Profile& profile, const pb::Hazard& hazard);

struct LayerKind {
  pb::Volume::Structure::Kind kind;
  pb::Layer::Tissue tissue;
};
/// What each of profileLayers is.
std::vector<LayerKind> layerKinds(const pb::Profile& profile);
/// 0xRRGGBB of each of profileLayers: its kind's, but a body's muscles take turns with reds of their own.
std::vector<std::uint32_t> layerColours(const pb::Profile& profile);
/// These reds.
std::span<const std::uint32_t> muscleColours();

}  // namespace needlelab

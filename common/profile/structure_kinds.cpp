#include "common/profile/structure_kinds.h"

#include <algorithm>
#include <array>

namespace needlelab {
namespace {

using Structure = pb::Volume::Structure;
using enum StructureShape;

// clang-format off
constexpr std::array<StructureKind, Structure::Kind_MAX> kStructureKinds = {{
    // kind, its tissue, its hazard, words, colour, shape, echo, grain
    {Structure::SKIN,      pb::Layer::SKIN,      pb::Hazard::OTHER,  "skin",          0xE8B48C, kSoft,  0.62F, 0.35F},
    {Structure::FAT,       pb::Layer::FAT,       pb::Hazard::OTHER,  "fat",           0xF3DC7E, kSoft,  0.26F, 0.5F},
    {Structure::MUSCLE,    pb::Layer::MUSCLE,    pb::Hazard::OTHER,  "muscle",        0xB4503C, kSoft,  0.34F, 0.75F},
    {Structure::FASCIA,    pb::Layer::OTHER,     pb::Hazard::OTHER,  "fascia",        0xD8CFC0, kSoft,  0.6F,  0.4F},
    {Structure::LIGAMENT,  pb::Layer::TENDON,    pb::Hazard::OTHER,  "ligament",      0xDDD2B4, kSolid, 0.52F, 0.6F},
    {Structure::TENDON,    pb::Layer::TENDON,    pb::Hazard::OTHER,  "tendon",        0xEAE3CF, kSolid, 0.58F, 0.6F},
    {Structure::CARTILAGE, pb::Layer::CARTILAGE, pb::Hazard::OTHER,  "cartilage",     0x7FB5A8, kSoft,  0.14F, 0.2F},
    {Structure::BONE,      pb::Layer::BONE,      pb::Hazard::BONE,   "bone",          0xF7F1E1, kBone,  0.3F,  0.3F},
    {Structure::NERVE,     pb::Layer::OTHER,     pb::Hazard::NERVE,  "nerve",         0xF2DC3C, kLine,  0.5F,  0.9F},
    {Structure::ARTERY,    pb::Layer::OTHER,     pb::Hazard::VESSEL, "artery",        0xD0392B, kLine,  0.04F, 0.15F},
    {Structure::VEIN,      pb::Layer::OTHER,     pb::Hazard::VESSEL, "vein",          0x5A79CF, kLine,  0.04F, 0.15F},
    {Structure::BURSA,     pb::Layer::BURSA,     pb::Hazard::OTHER,  "bursa",         0x8CCBEA, kSolid, 0.08F, 0.25F},
    {Structure::FLUID,     pb::Layer::OTHER,     pb::Hazard::OTHER,  "fluid",         0xA9D3EA, kSoft,  0.05F, 0.2F},
    {Structure::DURA,      pb::Layer::OTHER,     pb::Hazard::NERVE,  "dura",          0xC9B7CE, kSoft,  0.6F,  0.3F},
    {Structure::CAPSULE,   pb::Layer::CAPSULE,   pb::Hazard::OTHER,  "joint capsule", 0xC08FB4, kSoft,  0.55F, 0.45F},
    {Structure::DISC,      pb::Layer::CARTILAGE, pb::Hazard::OTHER,  "disc",          0xB9CBB4, kSolid, 0.3F,  0.4F},
    {Structure::SYNOVIUM,  pb::Layer::OTHER,     pb::Hazard::OTHER,  "synovium",      0xD9A9A0, kSoft,  0.3F,  0.5F},
    {Structure::OTHER,     pb::Layer::OTHER,     pb::Hazard::OTHER,  "other",         0x8A93A6, kSoft,  0.1F,  0.3F},
}};
// clang-format on

// neighbours in this order differ in lightness
constexpr std::array<std::uint32_t, 5> kMuscleColours = {0xB4503C, 0x86302F, 0xCB7A66, 0x9C3A48, 0xC76A42};

const Structure* structureWith(const pb::Profile& profile, const std::string& id) {
  const auto& all = profile.volume().structures();
  const auto found = std::ranges::find(all, id, &Structure::id);
  return found == all.end() ? nullptr : &*found;
}

}  // namespace

std::span<const StructureKind> structureKinds() {
  return kStructureKinds;
}

const StructureKind& structureKind(Structure::Kind kind) {
  const auto row = std::ranges::find(kStructureKinds, kind, &StructureKind::kind);
  return row == kStructureKinds.end() ? kStructureKinds.back() : *row;
}

Structure::Kind kindOf(pb::Layer::Tissue tissue) {
  // ligaments and discs have the tissue of others, which have its name
  Structure::Kind kind = Structure::OTHER;
  return Structure::Kind_Parse(pb::Layer::Tissue_Name(tissue), &kind) ? kind : Structure::OTHER;
}

Structure::Kind kindOf(const Structure& structure) {
  return structure.has_kind() ? structure.kind() : kindOf(structure.layer().tissue());
}

pb::Layer::Tissue tissueOf(const Structure& structure) {
  return structure.layer().has_tissue() ? structure.layer().tissue() : structureKind(structure.kind()).tissue;
}

pb::Hazard::Kind hazardKindOf(const pb::Profile& profile, const pb::Hazard& hazard) {
  if (hazard.has_kind()) return hazard.kind();
  const Structure* const structure = structureWith(profile, hazard.structure());
  return structure == nullptr ? pb::Hazard::OTHER : structureKind(kindOf(*structure)).hazard;
}

std::vector<LayerKind> layerKinds(const pb::Profile& profile) {
  std::vector<LayerKind> kinds;
  for (const Structure& structure : profile.volume().structures())
    kinds.push_back({kindOf(structure), tissueOf(structure)});
  for (const pb::Layer& layer : profile.layers()) kinds.push_back({kindOf(layer.tissue()), layer.tissue()});
  return kinds;
}

std::vector<std::uint32_t> layerColours(const pb::Profile& profile) {
  std::vector<std::uint32_t> colours;
  std::size_t muscles = 0;
  for (const LayerKind& layer : layerKinds(profile))
    colours.push_back(profile.has_volume() && layer.kind == Structure::MUSCLE
                          ? kMuscleColours[muscles++ % kMuscleColours.size()]
                          : structureKind(layer.kind).colour);
  return colours;
}

std::span<const std::uint32_t> muscleColours() {
  return kMuscleColours;
}

}  // namespace needlelab

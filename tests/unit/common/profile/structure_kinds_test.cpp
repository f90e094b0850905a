/// What follows from a structure's kind; and the console's file of kinds, which this test makes from the
/// rows: NEEDLELAB_WRITE_KINDS=1 bin/profile_test --gtest_filter='Console*'
#include "common/profile/structure_kinds.h"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/volume.h"
#include "common/profile/warnings.h"
#include "tests/support/anatomy/ball_profiles.h"

namespace needlelab {
namespace {

using Structure = pb::Volume::Structure;

std::string kindsModule() {
  std::string text =
      "// What structures are: what follows from each kind. Made by profile_test from the rows in\n"
      "// common/profile/structure_kinds.cpp; not to be edited (tests/unit/common/profile/structure_kinds_test.cpp).\n"
      "// prettier-ignore\nexport const kKinds = [\n";
  for (const StructureKind& row : structureKinds())
    text += fmt::format("  {{ name: '{}', words: '{}', tissue: '{}', hazard: '{}', color: '#{:06x}' }},\n",
                        Structure::Kind_Name(row.kind), row.words, pb::Layer::Tissue_Name(row.tissue),
                        pb::Hazard::Kind_Name(row.hazard), row.colour);
  text += "];\n/** The colours of a body's muscles, in turn. */\nexport const kMuscleColors = [";
  for (const std::uint32_t colour : muscleColours()) text += fmt::format("'#{:06x}', ", colour);
  text.replace(text.size() - 2, 2, "];\n");
  return text;
}

TEST(ConsoleKinds, areThoseOfTheRows) {
  const std::string path = std::string(NEEDLELAB_SOURCE_DIR) + "/client/web/app/profile/kinds.js";
  if (std::getenv("NEEDLELAB_WRITE_KINDS") != nullptr) std::ofstream(path) << kindsModule();
  std::stringstream found;
  found << std::ifstream(path).rdbuf();
  EXPECT_EQ(found.str(), kindsModule()) << "make it again, see above";
}

TEST(StructureKinds, everyKindHasItsRowAndEveryTissueItsKind) {
  ASSERT_EQ(structureKinds().size(), static_cast<std::size_t>(Structure::Kind_MAX));
  for (int number = 1; number <= Structure::Kind_MAX; ++number) {
    EXPECT_EQ(structureKinds()[static_cast<std::size_t>(number - 1)].kind, number);
    EXPECT_EQ(structureKind(static_cast<Structure::Kind>(number)).kind, number);
  }
  EXPECT_EQ(structureKind(Structure::KIND_UNSPECIFIED).kind, Structure::OTHER);
  for (int number = 1; number <= pb::Layer::Tissue_MAX; ++number) {
    const auto tissue = static_cast<pb::Layer::Tissue>(number);
    EXPECT_EQ(structureKind(kindOf(tissue)).tissue, tissue) << "there and back";
  }
}

TEST(StructureKinds, kindAndTissueFollowFromEachOther) {
  Structure structure;
  structure.mutable_layer()->set_tissue(pb::Layer::TENDON);
  EXPECT_EQ(kindOf(structure), Structure::TENDON);
  structure.set_kind(Structure::LIGAMENT);
  EXPECT_EQ(kindOf(structure), Structure::LIGAMENT);
  structure.mutable_layer()->set_tissue(pb::Layer::OTHER);
  EXPECT_EQ(tissueOf(structure), pb::Layer::OTHER) << "its own decides";
  structure.mutable_layer()->clear_tissue();
  EXPECT_EQ(tissueOf(structure), pb::Layer::TENDON);
}

/// A profile in which the structures have kinds in place of tissues, and the hazards no kind.
pb::Profile byKindAlone(pb::Profile profile) {
  for (Structure& structure : *profile.mutable_volume()->mutable_structures()) {
    structure.set_kind(kindOf(structure));
    structure.mutable_layer()->clear_tissue();
  }
  for (pb::Hazard& hazard : *profile.mutable_hazards())
    if (hazard.has_structure()) hazard.clear_kind();
  return profile;
}

TEST(StructureKinds, aBodyWithKindsAloneFeelsTheSame) {
  const auto profile = loadProfile(std::string(NEEDLELAB_SAMPLES) + "/volumes/wrist-median.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const auto bare = parseProfile(profileJson(byKindAlone(*profile)), "bare");
  ASSERT_TRUE(bare.ok()) << bare.error().message;
  const auto scene = sceneSpecOf(*profile), same = sceneSpecOf(*bare);
  ASSERT_TRUE(scene.ok() && same.ok());
  ASSERT_EQ(scene->layers.size(), same->layers.size());
  for (std::size_t i = 0; i < scene->layers.size(); ++i) {
    EXPECT_EQ(scene->layers[i].is_bone, same->layers[i].is_bone) << i;
    EXPECT_EQ(layerKinds(*profile)[i].kind, layerKinds(*bare)[i].kind) << i;
    EXPECT_EQ(fieldSpecOf(bare->volume()).structures[i].layer.is_bone, scene->layers[i].is_bone) << i;
  }
  EXPECT_EQ(bare->hazards(0).structure(), "nerve");
  EXPECT_EQ(hazardKindOf(*bare, bare->hazards(0)), pb::Hazard::NERVE);
  EXPECT_EQ(hazardKindOf(*bare, bare->hazards(1)), pb::Hazard::VESSEL);
  pb::Hazard own = bare->hazards(0);
  own.set_kind(pb::Hazard::OTHER);
  EXPECT_EQ(hazardKindOf(*bare, own), pb::Hazard::OTHER) << "its own decides";
}

TEST(StructureKinds, aBodysMusclesHaveRedsOfTheirOwn) {
  const auto profile = loadProfile(std::string(NEEDLELAB_SAMPLES) + "/volumes/lumbar-median.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  std::vector<std::uint32_t> muscles;
  const std::vector<std::uint32_t> colours = layerColours(*profile);
  for (std::size_t i = 0; i < colours.size(); ++i) {
    const StructureKind& row = structureKind(layerKinds(*profile)[i].kind);
    if (row.kind == Structure::MUSCLE)
      muscles.push_back(colours[i]);
    else
      EXPECT_EQ(colours[i], row.colour);
  }
  EXPECT_EQ(muscles, std::vector<std::uint32_t>(muscleColours().begin(), muscleColours().begin() + 4));
}

TEST(StructureKinds, faultsAreNamed) {
  const pb::Profile good = test::readProfile(test::withCyst());
  const auto faultOf = [&](const auto& change) {
    pb::Profile profile = good;
    change(*profile.mutable_volume()->mutable_structures(3));
    const auto read = parseProfile(profileJson(profile), "p");
    return read.ok() ? std::string() : read.error().message;
  };
  EXPECT_EQ(faultOf([](Structure& cyst) { cyst.mutable_layer()->clear_tissue(); }),
            "p: volume.structures[3].layer.tissue: is missing, and the structure has no kind");
  EXPECT_EQ(faultOf([](Structure& cyst) { cyst.set_kind(Structure::BONE); }),
            "p: volume.structures[3].kind: BONE contradicts layer.tissue, OTHER: bone is bone in both");
  EXPECT_EQ(faultOf([](Structure& cyst) {
              auto& way = *cyst.mutable_fibre()->mutable_direction();
              way.set_x(0), way.set_y(0), way.set_z(0);
            }),
            "p: volume.structures[3].fibre.direction: has no direction: its length is 0");
  EXPECT_EQ(faultOf([](Structure& cyst) { cyst.set_kind(Structure::FLUID), cyst.set_pulse_m(0.001); }), "");
  pb::Profile shape = good;
  pb::Hazard& hazard = *shape.add_hazards();
  hazard.set_name("cyst");
  hazard.set_structure("cyst");
  EXPECT_TRUE(parseProfile(profileJson(shape), "p").ok());
}

}  // namespace
}  // namespace needlelab

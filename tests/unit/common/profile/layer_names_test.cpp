#include "common/profile/layer_names.h"

#include <gmock/gmock.h>

#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "common/profile/profile.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

/// The good profile with layers of these tissues and names in front of its own; "" means no name.
std::string withLayers(const std::vector<std::pair<const char*, std::string>>& layers) {
  auto tree = nlohmann::json::parse(kGoodProfile);
  const nlohmann::json layer = tree["layers"][1];
  tree["layers"] = nlohmann::json::array();
  for (const auto& [tissue, name] : layers) {
    tree["layers"].push_back(layer);
    tree["layers"].back()["tissue"] = tissue;
    if (!name.empty()) tree["layers"].back()["name"] = name;
  }
  return tree.dump();
}

TEST(LayerNames, areThoseOfTheTableThatTheConsoleHasToo) {
  const auto text = readWholeFile(NEEDLELAB_LAYER_NAMES);
  ASSERT_TRUE(text.ok()) << text.error().message;
  const auto rows = nlohmann::json::parse(*text);
  ASSERT_GE(rows.size(), 6u);
  for (const auto& row : rows) {
    pb::Profile profile;
    for (const auto& layer : row["layers"]) {
      pb::Layer::Tissue tissue{};
      ASSERT_TRUE(pb::Layer::Tissue_Parse(layer["tissue"].get<std::string>(), &tissue));
      profile.add_layers()->set_tissue(tissue);
      if (layer.contains("name"))
        profile.mutable_layers(profile.layers_size() - 1)->set_name(layer["name"].get<std::string>());
    }
    EXPECT_EQ(layerNames(profile), row["names"].get<std::vector<std::string>>()) << row["says"];
  }
}

TEST(LayerNames, everyTissueHasItsOwnName) {
  pb::Profile profile;
  for (int tissue = pb::Layer::Tissue_MIN; tissue <= pb::Layer::Tissue_MAX; ++tissue)
    profile.add_layers()->set_tissue(static_cast<pb::Layer::Tissue>(tissue));
  const auto names = layerNames(profile);
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size());
}

TEST(LayerNames, twoLayersAreNeverCalledAlike) {
  const struct {
    std::vector<std::pair<const char*, std::string>> layers;
    const char* fault;
  } cases[] = {
      {{{"SKIN", ""}, {"TENDON", "dura"}, {"OTHER", "dura"}},
       "p: layers[2].name: \"dura\" is the name of layers[1], too: give each layer a name of its own"},
      // a default name counts, too, whichever of the two comes first
      {{{"SKIN", ""}, {"FAT", "skin"}},
       "p: layers[1].name: \"skin\" is what layers[0] is called, which has no name"},
      {{{"FAT", "skin"}, {"SKIN", ""}},
       "p: layers[0].name: \"skin\" is what layers[1] is called, which has no name"},
      {{{"FAT", "tendon 2"}, {"TENDON", ""}, {"TENDON", ""}},
       "p: layers[0].name: \"tendon 2\" is what layers[2] is called"},
      {{{"OTHER", ""}, {"SKIN", "layer 1"}}, "p: layers[1].name: \"layer 1\" is what layers[0] is called"},
      // a screen that capitalises the start of a line would show both alike
      {{{"SKIN", ""}, {"TENDON", "dura"}, {"OTHER", "Dura"}},
       "p: layers[2].name: \"Dura\" is the name of layers[1], too; capitals do not tell names apart: give "
       "each"},
      {{{"FAT", "Fat"}, {"FAT", ""}}, "p: layers[0].name: \"Fat\" is what layers[1] is called"},
  };
  for (const auto& c : cases) {
    const auto profile = parseProfile(withLayers(c.layers), "p");
    ASSERT_FALSE(profile.ok()) << c.fault;
    EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(profile.error().message, HasSubstr(c.fault));
  }
  // the second fat is "fat", not "fat 2"
  for (const auto& layers : std::vector<std::vector<std::pair<const char*, std::string>>>{
           {{"FAT", "subcutaneous fat"}, {"FAT", ""}}, {{"FAT", "fat 2"}, {"FAT", ""}}})
    EXPECT_TRUE(parseProfile(withLayers(layers), "p").ok());
}

TEST(LayerNames, aNameIsWrittenAfterItsTissueAndReadBack) {
  const std::string longest(64, 'x');
  const auto profile =
      parseProfile(withLayers({{"SKIN", ""}, {"OTHER", "Gelenkhöhle"}, {"OTHER", longest}}), "p");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const std::string json = profileJson(*profile);
  const auto layer = nlohmann::ordered_json::parse(json)["layers"][1];
  EXPECT_EQ(std::next(layer.begin()).key(), "name");
  EXPECT_EQ(layer["name"], "Gelenkhöhle");
  const auto again = parseProfile(json, "again");
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(profileJson(*again), json);
  EXPECT_EQ(layerNames(*again), (std::vector<std::string>{"skin", "Gelenkhöhle", longest}));
}

}  // namespace
}  // namespace needlelab

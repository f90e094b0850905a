#include "common/base/text/strict_json.h"

#include <gtest/gtest.h>

#include <string>

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

TEST(StrictJson, keepsInputUpTo64Levels) {
  const std::string text = R"({"b":[1,2.5,"x",null,true],"a":{"deep":[[[{"k":[]}]]]}})";
  EXPECT_EQ(readShallowJson<Json>(text).dump(), text);
  const std::string deep = std::string(64, '[') + "7" + std::string(64, ']');
  EXPECT_EQ(readShallowJson<Json>(deep).dump(), deep);
}

TEST(StrictJson, omitsDeeperLevelsSoWritingNeedsNoStack) {
  constexpr std::size_t kLevels = 400'000;
  std::string objects;
  for (std::size_t i = 0; i < kLevels; ++i) objects += R"({"a":)";
  objects += "1" + std::string(kLevels, '}');
  for (const std::string& text : {std::string(kLevels, '[') + std::string(kLevels, ']'), objects}) {
    const auto value = readShallowJson<Json>(text);
    ASSERT_FALSE(value.is_discarded());
    EXPECT_LT(value.dump().size(), 1000u);
  }
}

TEST(StrictJson, isDiscardedWhenTheTextIsInvalid) {
  for (const char* text : {"", "{", "[1,]", "nul", "{} x", "[[[["})
    EXPECT_TRUE(readShallowJson<Json>(text).is_discarded()) << text;
  EXPECT_TRUE(readShallowJson<Json>(std::string(400'000, '[')).is_discarded());
}

}  // namespace
}  // namespace needlelab

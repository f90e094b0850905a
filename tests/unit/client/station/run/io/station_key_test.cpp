#include <gmock/gmock.h>

#include "client/station/run/io/station_key.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

const std::string kHex = "00ff10a0" + std::string(54, '3') + "Aa";

TEST(StationKey, nameAndKeyAreRead) {
  auto key = parseStationKey("room 4: left:" + kHex + "\r\n", "k");
  ASSERT_TRUE(key.ok()) << key.error().message;
  EXPECT_EQ(key->station, "room 4: left") << "the last ':' parts them";
  ASSERT_EQ(key->key.size(), 32u);
  EXPECT_EQ(key->key.substr(0, 4), std::string("\x00\xff\x10\xa0", 4));
  EXPECT_EQ(key->key.back(), '\xaa');
}

TEST(StationKey, wrongFilesAreRefusedWithoutShowingTheKey) {
  const std::string texts[] = {"",
                               "\n",
                               kHex,
                               ":" + kHex,
                               "a:",
                               "a:" + kHex.substr(1),
                               "a:" + kHex + "0",
                               "a:" + std::string(63, '3') + "x",
                               std::string(101, 'n') + ":" + kHex,
                               "a\nb:" + kHex,
                               "a:" + kHex + "\nb:" + kHex};
  for (const std::string& text : texts) {
    auto key = parseStationKey(text, "/etc/needlelab/key");
    ASSERT_FALSE(key.ok()) << text;
    EXPECT_EQ(key.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(key.error().message, HasSubstr("/etc/needlelab/key"));
    EXPECT_THAT(key.error().message, testing::Not(HasSubstr("333333")));
  }
  EXPECT_THAT(loadStationKey("/nowhere/key").error().message, HasSubstr("/nowhere/key"));
}

}  // namespace
}  // namespace needlelab

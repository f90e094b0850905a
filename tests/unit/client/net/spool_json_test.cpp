#include "client/net/spool_json.h"

#include <gmock/gmock.h>

#include "common/base/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

TEST(SpoolJson, theSealIsTheCrcOfWhatStandsBefore) {
  const std::string text = sealed("{}");
  EXPECT_EQ(text.size(), 3 + 16u);
  EXPECT_TRUE(text.starts_with("{}\ncrc32c "));
  EXPECT_EQ(*unsealed(text), "{}\n");
}

TEST(SpoolJson, aTextOfAnEarlierVersionIsReadAsItIs) {
  for (const std::string& text : {std::string(), std::string("{}"),
                                  std::string("{\"a\": \"crc32c 00000000\"}\n"), std::string(40, ' ')})
    EXPECT_EQ(*unsealed(text), text);
}

TEST(SpoolJson, everyFlippedBitIsNoticed) {
  const TempFolder folder;
  const auto file = folder.path() / "file.json";
  ASSERT_TRUE(writeSpoolJson(file, {{"chunks", 5}, {"safe", 0}, {"closed", true}}).ok());
  const std::string text = *readWholeFile(file);
  ASSERT_EQ(countAt(*readSpoolJson(file), "chunks"), 5u);
  for (std::size_t at = 0; at < text.size(); ++at)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = text;
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << bit));
      folder.write("file.json", damaged);
      EXPECT_FALSE(readSpoolJson(file).ok()) << "byte " << at << ", bit " << bit << ":\n" << damaged;
    }
}

}  // namespace
}  // namespace needlelab::test

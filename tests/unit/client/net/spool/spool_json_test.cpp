#include "client/net/spool/spool_json.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "common/base/files/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

TEST(SpoolJson, theSealIsTheCrcOfThePrecedingText) {
  const std::string text = sealed("{}");
  EXPECT_EQ(text.size(), 3 + 16u);
  EXPECT_TRUE(text.starts_with("{}\ncrc32c "));
  EXPECT_EQ(*unsealed(text), "{}\n");
}

TEST(SpoolJson, aTextWithoutASealIsDamaged) {
  for (const std::string& text : {std::string(), std::string("{}"),
                                  std::string("{\"a\": \"crc32c 00000000\"}\n"), std::string(40, ' ')}) {
    EXPECT_FALSE(hasSeal(text)) << text;
    EXPECT_FALSE(unsealed(text).ok()) << text;
  }
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

TEST(SpoolJson, whatIsNestedDeeperThanAnyFileOfTheSpoolIsRefused) {
  const TempFolder folder;
  const auto nested = [](std::size_t depth) {
    return sealed("{\"a\": " + std::string(depth, '[') + std::string(depth, ']') + "}");
  };
  EXPECT_TRUE(readSpoolJson(folder.write("file.json", nested(10))).ok());
  for (const std::size_t depth : {20u, 500'000u}) {
    const auto deep = readSpoolJson(folder.write("file.json", nested(depth)));
    ASSERT_FALSE(deep.ok());
    EXPECT_EQ(deep.error().code, ErrorCode::kCorrupt);
  }
}

TEST(SpoolJson, aPipeOrLinkInTheSpoolIsRefusedAtOnce) {
  const TempFolder folder;
  const auto pipe = folder.path() / "pipe.json", link = folder.path() / "link.json";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::filesystem::create_symlink(folder.write("elsewhere", "{}"), link);
  for (const auto& file : {pipe, link}) {
    const auto read = readSpoolJson(file);
    ASSERT_FALSE(read.ok());
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(read.error().message, testing::HasSubstr(file.string() + ": is not a regular file"));
    EXPECT_EQ(writeSpoolJson(file, {{"chunks", 5}}).error().code, ErrorCode::kUnavailable);
  }
  EXPECT_EQ(*readWholeFile(folder.path() / "elsewhere"), "{}");
}

}  // namespace
}  // namespace needlelab::test

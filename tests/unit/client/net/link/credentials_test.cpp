#include "client/net/link/credentials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

TEST(Credentials, aPasswordIsTheFirstLineOfTheFile) {
  const test::TempFolder folder;
  EXPECT_EQ(*readPassword(folder.write("a", "correct horse\nsecond line\n"), ""), "correct horse");
  EXPECT_EQ(*readPassword(folder.write("b", "no newline"), ""), "no newline");
  EXPECT_EQ(*readPassword(folder.write("c", "windows\r\n"), ""), "windows");
  EXPECT_EQ(*readPassword(folder.write("d", " spaces stay "), ""), " spaces stay ");
}

TEST(Credentials, emptyLongAndMissingPasswordsAreRefusedByName) {
  const test::TempFolder folder;
  for (const auto& file :
       {folder.write("empty", "\nx"), folder.write("long", std::string(1025, 'x')), folder.path() / "none"}) {
    const auto password = readPassword(file, "");
    ASSERT_FALSE(password.ok()) << file;
    EXPECT_EQ(password.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(password.error().message, testing::HasSubstr(file.string()));
    const auto code = passwordFromFile(file, "code");
    ASSERT_FALSE(code.ok()) << file;
    EXPECT_THAT(code.error().message, testing::HasSubstr(file.string()));
    EXPECT_THAT(code.error().message, testing::Not(testing::HasSubstr("xxx")));
  }
}

TEST(Credentials, aSecretIsTheFirstLineAndMayBeAnything) {
  const test::TempFolder folder;
  EXPECT_EQ(*readSecretLine(folder.write("a", "4711\r\nsecond line")), "4711");
  EXPECT_EQ(*readSecretLine(folder.write("empty", "")), "");
  const auto missing = readSecretLine(folder.path() / "none");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab

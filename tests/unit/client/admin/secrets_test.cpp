#include "client/admin/secrets.h"

#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

TEST(PasswordFile, itsFirstLineCounts) {
  const test::TempFolder folder;
  EXPECT_EQ(*passwordFromFile(folder.write("a", "secret word\nnot this")), "secret word");
  EXPECT_EQ(*passwordFromFile(folder.write("b", "secret\r\n")), "secret");
  EXPECT_EQ(*passwordFromFile(folder.write("c", "no end")), "no end");
}

TEST(PasswordFile, missingEmptyOrHugeIsWrongInput) {
  const test::TempFolder folder;
  for (const auto& path : {folder.path() / "none", folder.write("a", ""), folder.write("b", "\nsecond line"),
                           folder.write("c", std::string(10'000, 'x'))}) {
    const auto refused = passwordFromFile(path);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(refused.error().message.find(path.string()), std::string::npos);
    EXPECT_EQ(refused.error().message.find("xxx"), std::string::npos);
  }
}

}  // namespace
}  // namespace needlelab

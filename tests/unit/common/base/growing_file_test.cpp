#include "common/base/growing_file.h"

#include <gtest/gtest.h>

#include "common/base/atomic_file.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

std::size_t filesIn(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(GrowingFile, appearsWhenFinished) {
  const test::TempFolder folder;
  const auto path = folder.path() / "out";
  auto file = GrowingFile::create(path);
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(file->append(viewOf("one ")).ok());
  EXPECT_FALSE(std::filesystem::exists(path));
  ASSERT_TRUE(file->append(viewOf("two")).ok());
  ASSERT_TRUE(file->finish().ok());
  EXPECT_EQ(*readWholeFile(path), "one two");
  EXPECT_EQ(filesIn(folder.path()), 1u);
}

TEST(GrowingFile, leavesNothingUnfinished) {
  const test::TempFolder folder;
  const auto path = folder.write("out", "old");
  {
    auto file = GrowingFile::create(path);
    ASSERT_TRUE(file.ok());
    GrowingFile moved = std::move(*file);
    ASSERT_TRUE(moved.append(viewOf("new")).ok());
  }
  EXPECT_EQ(*readWholeFile(path), "old");
  EXPECT_EQ(filesIn(folder.path()), 1u);
}

TEST(GrowingFile, whatIsNoFileIsNotReplacedByOne) {
  const test::TempFolder folder;
  for (const std::filesystem::path& there : {std::filesystem::path("/dev/null"), folder.path()}) {
    const auto file = GrowingFile::create(there);
    ASSERT_FALSE(file.ok());
    EXPECT_EQ(file.error().code, ErrorCode::kInvalidInput);
  }
  EXPECT_EQ(filesIn(folder.path()), 0u);
}

TEST(GrowingFile, aMissingFolderIsWrongInput) {
  const test::TempFolder folder;
  const auto file = GrowingFile::create(folder.path() / "none" / "out");
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(file.error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab

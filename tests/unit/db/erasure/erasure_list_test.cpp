#include "db/erasure/erasure.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(ErasureList, keepsEachPersonOnceAndTheOrder) {
  const test::TempFolder folder;
  const Uuid lab = makeUuidV7();
  const ErasureLine first{lab, makeUuidV7(), 5}, second{lab, makeUuidV7(), 6};
  EXPECT_TRUE(readErasures(folder.path())->empty()) << "there is no file";
  ASSERT_TRUE(addErasures(folder.path(), {first}).ok());
  ASSERT_TRUE(addErasures(folder.path(), {second, first, {lab, first.person, 9}}).ok());
  EXPECT_THAT(*readErasures(folder.path()), ElementsAre(first, second));
  ASSERT_TRUE(writeErasures(folder.path(), {second}).ok());
  EXPECT_THAT(*readErasures(folder.path()), ElementsAre(second));
  // in another lab it is another person
  ASSERT_TRUE(addErasures(folder.path(), {{makeUuidV7(), second.person, 6}}).ok());
  EXPECT_EQ(readErasures(folder.path())->size(), 2u);
}

TEST(ErasureList, namesTheInvalidLine) {
  const test::TempFolder folder;
  const std::string good = uuidText(makeUuidV7()) + " " + uuidText(makeUuidV7()) + " 5\n";
  for (const char* bad : {"anna", "", "1 2 3", " x"}) {
    std::ofstream(folder.path() / kErasuresFile) << good << bad << "\n";
    const auto read = readErasures(folder.path());
    ASSERT_FALSE(read.ok()) << bad;
    EXPECT_EQ(read.error().code, ErrorCode::kCorrupt);
    EXPECT_THAT(read.error().message, HasSubstr("line 2"));
    EXPECT_FALSE(addErasures(folder.path(), {{}}).ok()) << "nothing is overwritten";
  }
}

}  // namespace
}  // namespace needlelab

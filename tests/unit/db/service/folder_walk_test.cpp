// What a walk through folders finds in which others write meanwhile.
#include "db/service/folder_walk.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <set>
#include <string>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class FolderWalkTest : public testing::Test {
 protected:
  fs::path put(const std::string& name) {
    fs::create_directories((top / name).parent_path());
    return folder.write(name, "text");
  }
  /// All entries; `meanwhile` is done after each.
  void walk(
      FolderWalk& through, const std::function<void()>& meanwhile = [] {}) {
    files.clear();
    unread.clear();
    entries = 0;
    while (const auto entry = through.next()) {
      if (entry->kind == FolderWalk::Kind::kFile) files.insert(entry->path.lexically_relative(top));
      if (entry->kind == FolderWalk::Kind::kUnread) unread.insert(entry->path.lexically_relative(top));
      if (entry->kind == FolderWalk::Kind::kVanished) through.noteVanished();
      ++entries;
      meanwhile();
    }
  }
  test::TempFolder folder;
  const fs::path top = folder.path();
  std::set<std::string> files, unread;
  int entries = 0;
};

TEST_F(FolderWalkTest, readsFilesOfAllLevelsThatAreNotEmptyAndFollowsNoLink) {
  for (const char* name : {"a", "b/c", "b/d/e"}) put(name);
  folder.write("empty", "");
  fs::create_directory_symlink(top, top / "b" / "round");
  fs::create_symlink(top / "a", top / "link");
  ASSERT_EQ(::mkfifo((top / "pipe").c_str(), 0600), 0);
  FolderWalk all(top, 2);
  walk(all);
  EXPECT_THAT(files, UnorderedElementsAre("a", "b/c", "b/d/e"));
  EXPECT_THAT(unread, IsEmpty());
  fs::create_directory_symlink(top, top / "b" / "root");
  FolderWalk by_link(top / "b" / "root", 2);
  walk(by_link);
  EXPECT_EQ(files.size(), 3u) << "but the first one";
}

TEST_F(FolderWalkTest, tellsFoldersThatAreTooDeep) {
  for (const char* name : {"a", "b/c", "b/d/e"}) put(name);
  FolderWalk one(top, 1);
  walk(one);
  EXPECT_THAT(files, UnorderedElementsAre("a", "b/c"));
  EXPECT_THAT(unread, UnorderedElementsAre("b/d"));
  FolderWalk none(top, 0);
  walk(none);
  EXPECT_THAT(files, UnorderedElementsAre("a"));
  EXPECT_THAT(unread, IsEmpty()) << "they are none of its";
}

TEST_F(FolderWalkTest, tellsFoldersThatItMayNotReadAndGoesOn) {
  for (const char* name : {"a", "b/c", "d/e", "f"}) put(name);
  fs::permissions(top, fs::perms(0755));
  fs::permissions(top / "d", fs::perms(0755));
  fs::permissions(top / "b", fs::perms::none);
  FolderWalk all(top, 16);
  const bool root = ::geteuid() == 0;  // who may read all
  ASSERT_EQ(::seteuid(root ? 65534 : ::geteuid()), 0);
  walk(all);
  ASSERT_EQ(::seteuid(root ? 0 : ::geteuid()), 0);
  fs::permissions(top / "b", fs::perms::owner_all);
  EXPECT_THAT(files, UnorderedElementsAre("a", "d/e", "f"));
  EXPECT_THAT(unread, UnorderedElementsAre("b"));
}

TEST_F(FolderWalkTest, tellsAFirstFolderThatIsNoneAndPassesOneThatIsGone) {
  put("a");
  FolderWalk file(top / "a", 16);
  walk(file);
  EXPECT_THAT(unread, UnorderedElementsAre("a"));
  FolderWalk gone(top / "none", 16);
  walk(gone);
  EXPECT_THAT(unread, IsEmpty());
}

TEST_F(FolderWalkTest, goesOnWithTheSiblingsOfAFolderThatVanishes) {
  std::set<std::string> stay;
  for (int i = 0; i < 50; ++i) {
    fs::create_directories(top / ("goes" + std::to_string(i)) / "below");
    stay.insert(put("stays" + std::to_string(i) + "/file").lexically_relative(top));
  }
  FolderWalk all(top, 16);
  walk(all, [&] {
    // within some of them, too
    if (entries != 3) return;
    for (int i = 0; i < 50; ++i) fs::remove_all(top / ("goes" + std::to_string(i)));
  });
  EXPECT_EQ(files, stay);
  EXPECT_THAT(unread, IsEmpty());
}

TEST_F(FolderWalkTest, readsAFolderAgainOfWhichNamesVanish) {
  constexpr int kFiles = 10;
  std::set<std::string> later;
  for (int i = 0; i < kFiles; ++i) {
    put("below/b" + std::to_string(i));
    later.insert("below/c" + std::to_string(i));
  }
  FolderWalk all(top, 16);
  walk(all, [&] {
    // the folder, and one of its names
    if (entries != 2) return;
    for (int i = 0; i < kFiles; ++i)
      fs::rename(top / "below" / ("b" + std::to_string(i)), top / "below" / ("c" + std::to_string(i)));
  });
  EXPECT_TRUE(std::includes(files.begin(), files.end(), later.begin(), later.end()));
  EXPECT_THAT(unread, IsEmpty());
  EXPECT_EQ(entries, 1 + 2 * (kFiles + 1) + 1) << "the folder's own and its end, and each file twice";
}

TEST_F(FolderWalkTest, tellsFoldersThatGoOnChangingAndReadsThemABoundedNumberOfTimes) {
  constexpr int kFolders = 10, kFiles = 4;
  std::set<std::string> changing;
  const auto file = [&](int in, bool first, int i) {
    return top / std::to_string(in) / ((first ? "b" : "c") + std::to_string(i));
  };
  for (int in = 0; in < kFolders; ++in) {
    changing.insert(std::to_string(in));
    for (int i = 0; i < kFiles; ++i) put(std::to_string(in) + "/b" + std::to_string(i));
  }
  put("stays");
  bool first = true;
  FolderWalk all(top, 16);
  walk(all, [&] {
    for (int in = 0; in < kFolders; ++in)
      for (int i = 0; i < kFiles; ++i) fs::rename(file(in, first, i), file(in, !first, i));
    first = !first;
  });
  EXPECT_EQ(unread, changing);
  EXPECT_TRUE(files.contains("stays"));
  constexpr int kReadings = kFolders + FolderWalk::kMostReadAgainInAll;
  EXPECT_EQ(entries, kFolders + kReadings * (kFiles + 1) + 2);
}

}  // namespace
}  // namespace needlelab

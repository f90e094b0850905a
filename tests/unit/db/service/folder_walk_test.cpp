// What a walk through folders finds in which others write meanwhile.
#include "db/service/folder_walk.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string>
#include <vector>

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
  EXPECT_EQ(entries, 1 + 2 * (kFiles + 1) + 1 + kFiles)
      << "the folder's own and its end, each file twice, and each that arrived";
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
  EXPECT_TRUE(std::includes(unread.begin(), unread.end(), changing.begin(), changing.end()));
  EXPECT_TRUE(files.contains("stays"));
  constexpr int kReadings = kFolders + FolderWalk::kMostReadAgainInAll;
  constexpr int kOfFolders = kFolders + kReadings * (kFiles + 1) + 2;
  constexpr int kTold = 2 * kFolders + 1;  // of those that go on changing
  EXPECT_LE(entries, (FolderWalk::kMostReadAgain + 1) * kOfFolders + int{FolderWalk::kMostArrived} + kTold);
}

// Somebody moved backups from folders that were still to be read into one that had been read.
TEST_F(FolderWalkTest, readsWhatMovesIntoAFolderThatItHasRead) {
  constexpr int kFolders = 400;
  for (int i = 0; i < kFolders; ++i) fs::create_directory(top / std::to_string(i));
  std::vector<fs::path> order;
  for (const auto& at : fs::directory_iterator(top)) order.push_back(at.path());
  const fs::path first = order.front(), last = order.back();
  put((last / "x" / "below" / "backup").lexically_relative(top));
  put((last / "alone").lexically_relative(top));
  FolderWalk all(top, 16);
  walk(all, [&] {
    // the first one and its end
    if (entries != 3) return;
    fs::rename(last / "x", first / "x");
    fs::rename(last / "alone", first / "alone");
  });
  EXPECT_THAT(files, UnorderedElementsAre((first / "x" / "below" / "backup").lexically_relative(top),
                                          (first / "alone").lexically_relative(top)));
  EXPECT_THAT(unread, IsEmpty());
  EXPECT_EQ(entries, 2 * kFolders + 1 + 6) << "x and alone arrived; x and below have two entries each";
}

TEST_F(FolderWalkTest, findsWhatArrivesInAFolderThatMovedItself) {
  put("a/x/file");
  fs::create_directory(top / "b");
  const fs::path outside = folder.path().string() + ".outside";
  std::ofstream(outside) << "text";
  FolderWalk all(top, 16);
  walk(all, [&] {
    // x was read, wherever the system lists it
    if (!files.contains("a/x/file") || fs::exists(top / "b" / "y")) return;
    fs::rename(top / "a" / "x", top / "b" / "y");
    fs::rename(outside, top / "b" / "y" / "late");
  });
  EXPECT_TRUE(files.contains("b/y/late"));
  EXPECT_THAT(unread, IsEmpty());
}

TEST_F(FolderWalkTest, readsWhatMovesFromOneOfItsPlacesToAnother) {
  put("one/a");
  put("two/backup");
  FolderWalk both({{top / "one", 16}, {top / "two", 0}});
  walk(both, [&] {
    if (entries == 2) fs::rename(top / "two" / "backup", top / "one" / "backup");
  });
  EXPECT_THAT(files, UnorderedElementsAre("one/a", "one/backup"));
}

TEST_F(FolderWalkTest, tellsTheFoldersBetweenWhichAFileGoesOnMoving) {
  put("stays/file");
  for (const char* name : {"a", "b"}) fs::create_directory(top / name);
  put("a/moves");
  bool in_a = true;
  FolderWalk all(top, 16);
  walk(all, [&] {
    fs::rename(top / (in_a ? "a" : "b") / "moves", top / (in_a ? "b" : "a") / "moves");
    in_a = !in_a;
  });
  EXPECT_TRUE(files.contains("stays/file"));
  EXPECT_TRUE(files.contains("a/moves") || files.contains("b/moves") || !unread.empty());
  EXPECT_TRUE(unread.contains("a") || unread.contains("b"));
  EXPECT_LE(entries, (FolderWalk::kMostReadAgain + 1) * 40 + int{FolderWalk::kMostArrived});
}

}  // namespace
}  // namespace needlelab

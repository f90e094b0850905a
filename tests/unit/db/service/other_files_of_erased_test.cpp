// What an erasure says of files that are no databases, and of folders.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "db/erasure_list.h"
#include "tests/support/fake_time.h"
#include "tests/unit/db/service/files_of_erased_fixture.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

using OtherFilesOfErased = test::FilesOfErasedTest;

/// Does something at one reading of the clock: between two entries of a folder.
class MeanwhileTime : public test::FakeTime {
 public:
  MeanwhileTime(int reading, std::function<void()> meanwhile)
      : reading_(reading), meanwhile_(std::move(meanwhile)) {}
  [[nodiscard]] std::int64_t nowNs() noexcept override {
    if (--reading_ == 0) meanwhile_();
    return FakeTime::nowNs();
  }

 private:
  int reading_;
  std::function<void()> meanwhile_;
};

// Who may write beside the backups made and removed folders there, and the erasure named no backup.
TEST_F(OtherFilesOfErased, areFoundThoughFoldersBesideThemVanishMeanwhile) {
  addNamed("tom", "");
  const auto one = backup("one.db");
  const fs::path disk = folder.path() / "disk";
  constexpr int kFolders = 20;
  for (int first = 1; first <= 2 * kFolders; ++first) {
    fs::remove_all(disk);
    std::vector<std::string> copies{one.string()};
    for (int i = 0; i < kFolders; ++i) {
      const std::string number = std::to_string(i);
      fs::create_directories(disk / ("goes" + number));
      fs::create_directories(disk / ("stays" + number));
      copies.push_back((folder.path() / "data" / "backups" / ("stays" + number) / "copy.db").string());
      fs::create_hard_link(one, disk / ("stays" + number) / "copy.db");
    }
    std::error_code there;
    fs::create_directory_symlink(disk, folder.path() / "data" / "backups", there);
    MeanwhileTime time(10 + first, [&disk] {
      for (int i = 0; i < kFolders; ++i) fs::remove(disk / ("goes" + std::to_string(i)));
    });
    EXPECT_THAT(look(rowsOf("tom"), kMostTimeOfFiles, time), testing::UnorderedElementsAreArray(copies))
        << "gone at entry " << first;
  }
}

// Somebody renamed backups to and fro: the erasure named some of them only.
TEST_F(OtherFilesOfErased, areFoundThoughTheyAreRenamedMeanwhile) {
  addNamed("tom", "");
  const fs::path one = backup("one.db"), backups = folder.path() / "data" / "backups";
  constexpr int kCopies = 6;
  for (int reading = 1; reading <= 30; ++reading) {
    fs::remove_all(backups);
    fs::create_directory(backups);
    std::vector<std::string> before, after;
    for (int i = 0; i < kCopies; ++i) {
      before.push_back((backups / ("b" + std::to_string(i) + ".db")).string());
      after.push_back((backups / ("c" + std::to_string(i) + ".db")).string());
      fs::create_hard_link(one, before.back());
    }
    MeanwhileTime time(reading, [&] {
      for (std::size_t i = 0; i < kCopies; ++i) fs::rename(before[i], after[i]);
    });
    const auto found = look(rowsOf("tom"), kMostTimeOfFiles, time);
    for (std::size_t i = 0; i < kCopies; ++i)
      EXPECT_TRUE(std::count(found.begin(), found.end(), before[i]) +
                      std::count(found.begin(), found.end(), after[i]) >
                  0)
          << "backup " << i << ", renamed at reading " << reading;
  }
}

// Somebody moved backups into a folder that the erasure had read: it named none of them.
TEST_F(OtherFilesOfErased, areFoundThoughTheyMoveToAnotherFolderMeanwhile) {
  addNamed("tom", "");
  const fs::path one = backup("one.db"), backups = folder.path() / "data" / "backups";
  for (int reading = 1; reading <= 30; ++reading) {
    fs::remove_all(backups);
    for (int i = 0; i < 6; ++i) fs::create_directories(backups / ("f" + std::to_string(i)));
    fs::create_directory(backups / "f5" / "x");
    fs::create_hard_link(one, backups / "f5" / "x" / "copy.db");
    // to each folder, one of which was read first
    const fs::path to = backups / ("f" + std::to_string(reading % 5)) / "x";
    MeanwhileTime time(reading, [&] { fs::rename(backups / "f5" / "x", to); });
    const auto found = look(rowsOf("tom"), kMostTimeOfFiles, time);
    EXPECT_TRUE(std::count(found.begin(), found.end(), (to / "copy.db").string()) +
                    std::count(found.begin(), found.end(), (backups / "f5" / "x" / "copy.db").string()) >
                0)
        << "moved at reading " << reading;
  }
}

TEST_F(OtherFilesOfErased, areFoundWhereNoPathReaches) {
  addNamed("tom", "");
  const std::string copy = *readWholeFile(backup("one.db"));
  fs::path deep = folder.path() / "data";
  int in = ::open(deep.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  for (int level = 0; level < 16; ++level) {
    const std::string name(255, 'd');
    deep /= name;
    ASSERT_EQ(::mkdirat(in, name.c_str(), 0700), 0);
    const int below = ::openat(in, name.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    ::close(in);
    in = below;
  }
  for (const char* name : {"copy.db", "people.txt"}) {
    const int file = ::openat(in, name, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    EXPECT_EQ(::write(file, copy.data(), copy.size()), static_cast<ssize_t>(copy.size()));
    ::close(file);
  }
  ::close(in);
  EXPECT_THAT(filesOf("tom"),
              testing::UnorderedElementsAre((kept / "one.db").string(), (deep / "copy.db").string(),
                                            (deep / "people.txt").string()));
}

TEST_F(OtherFilesOfErased, areAlsoCompressedCopiesTextsAndFoldersThatNobodyLooksInto) {
  addNamed("tom", "");
  const fs::path data = folder.path() / "data";
  const auto write = [](const fs::path& file) {
    fs::create_directories(file.parent_path());
    std::ofstream(file) << "tom";
    return file.string();
  };
  const std::vector<std::string> files{write(data / "backups" / "needlelab-20260101T000000Z.db.gz"),
                                       write(data / "people.csv"), write(data / "zip" / "lock"),
                                       write(data / "zip" / "notes-journal"),
                                       write(data / "needlelab.db-wal.gz")};
  fs::path deep = data;
  for (int level = 0; level <= 16; ++level) deep /= std::to_string(level);
  write(deep / "people.csv");
  std::vector<std::string> listed = files;
  listed.push_back(deep.string());
  EXPECT_THAT(filesOf("tom"), testing::UnorderedElementsAreArray(listed));
  EXPECT_THAT(text, HasSubstr(deep.string()));
}

TEST_F(OtherFilesOfErased, areNoneOfTheServersOwn) {
  const fs::path data = folder.path() / "data";
  fs::create_directories(data / "backups");
  for (const char* name :
       {"lock", "pseudonym.key", "audit.key", "audit.head", "audit.head.replaced",
        "audit.head.replaced-undone", "erasures", "restore.pending", "audit.head.being-written-Ab3dEf",
        "backups/needlelab.erasures", "backups/needlelab.erasures.being-written-Ab3dEf"})
    if (!fs::exists(data / name)) std::ofstream(data / name) << "kept";
  fs::create_directories(data / "tls");
  for (const char* name : {"ca.crt", "ca.key", "server.crt", "server.key", "ca-next.crt", "ca-next.key",
                           "server.key.being-written-Ab3dEf"})
    std::ofstream(data / "tls" / name) << "kept";
  ASSERT_TRUE(fs::exists(data / "needlelab.db-wal"));
  std::ofstream(kept / kErasuresCopy) << "kept";
  EXPECT_THAT(look(rowsOf("nobody")), IsEmpty());
  EXPECT_THAT(others, IsEmpty());
}

TEST_F(OtherFilesOfErased, areDatabasesAlsoUnderTheNameOfAListOfErasures) {
  addNamed("tom", "");
  const fs::path list = kept / kErasuresCopy;
  fs::rename(backup("one.db"), list);
  EXPECT_THAT(look(rowsOf("tom")), ElementsAre(list.string()));
}

}  // namespace
}  // namespace needlelab

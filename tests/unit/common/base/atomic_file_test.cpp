#include "common/base/atomic_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <iterator>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

std::size_t entriesIn(const fs::path& folder) {
  return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFile, writesReplacesAndReadsBackWithTheAskedPermission) {
  const test::TempFolder folder;
  const auto path = folder.path() / "key";
  ASSERT_TRUE(writeFileAtomically(path, viewOf("one"), 0600).ok());
  ASSERT_TRUE(writeFileAtomically(path, viewOf("second"), 0600).ok());
  EXPECT_EQ(readWholeFile(path).value(), "second");
  struct stat info {};
  ASSERT_EQ(::stat(path.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777u, 0600u);
  EXPECT_EQ(entriesIn(folder.path()), 1u) << "no temporary file is left";
}

TEST(AtomicFile, bytesOfAnyKindAndSize) {
  const test::TempFolder folder;
  const auto path = folder.path() / "b";
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{3'000'001}}) {
    std::string text(size, '\0');
    for (std::size_t i = 0; i < size; ++i) text[i] = static_cast<char>(i * 31);
    ASSERT_TRUE(writeFileAtomically(path, viewOf(text)).ok());
    EXPECT_EQ(readWholeFile(path).value(), text);
  }
}

TEST(AtomicFile, aFailedWriteLeavesTheOldFileAndNoTemporary) {
  const test::TempFolder folder;
  const auto target = folder.path() / "there";
  fs::create_directory(target);  // a folder stands where the file should go: the rename fails
  folder.write("there/content", "kept");
  const Status status = writeFileAtomically(target, viewOf("new"));
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, ::testing::HasSubstr(target.string()));
  EXPECT_EQ(readWholeFile(target / "content").value(), "kept");
  EXPECT_EQ(entriesIn(folder.path()), 1u);
}

TEST(AtomicFile, missingFolderIsAnErrorWithThePath) {
  const test::TempFolder folder;
  const auto path = folder.path() / "no" / "file";
  const Status status = writeFileAtomically(path, viewOf("x"));
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, ::testing::HasSubstr(path.string()));
  EXPECT_FALSE(syncFolder(folder.path() / "no").ok());
}

// as root a rename would put a file in the place of /dev/null, for every program of the machine
TEST(AtomicFile, aPipeOrDeviceIsWrittenToAndNeverReplaced) {
  const test::TempFolder folder;
  const auto pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reader, 0);
  EXPECT_TRUE(writeFileAtomically(pipe, viewOf("through")).ok());
  char got[16] = {};
  EXPECT_EQ(::read(reader, got, sizeof got), 7);
  EXPECT_STREQ(got, "through");
  ::close(reader);
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_EQ(replaceableFile(pipe).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(replaceableFile(folder.path()).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(entriesIn(folder.path()), 1u);
}

TEST(AtomicFile, aLinkStaysALinkAndItsEndIsReplaced) {
  const test::TempFolder folder;
  const auto end = folder.write("end", "old");
  const auto link = folder.path() / "link";
  fs::create_symlink(end, link);
  ASSERT_TRUE(writeFileAtomically(link, viewOf("new")).ok());
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(readWholeFile(end).value(), "new");
  EXPECT_EQ(entriesIn(folder.path()), 2u);
}

TEST(ReadWholeFile, missingFolderAndTooLargeAreInvalidInput) {
  const test::TempFolder folder;
  for (const auto& file : {readWholeFile(folder.path() / "none"), readWholeFile(folder.path()),
                           readWholeFile(folder.write("big", "123456"), 5)}) {
    ASSERT_FALSE(file.ok());
    EXPECT_EQ(file.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(file.error().message, ::testing::HasSubstr(folder.path().string()));
  }
  EXPECT_EQ(readWholeFile(folder.path() / "big", 6).value(), "123456");
}

TEST(ReadWholeFile, aPipeThatNobodyWritesIsRefusedAtOnce) {
  const test::TempFolder folder;
  const auto pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(readWholeFile(pipe).error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab

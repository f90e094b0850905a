#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "common/base/files/files.h"
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

TEST(AtomicFile, isPrivateWhateverTheUmaskUnlessRequested) {
  const test::TempFolder folder;
  const auto modeOf = [&](const char* name) {
    struct stat info {};
    EXPECT_EQ(::stat((folder.path() / name).c_str(), &info), 0) << name;
    return info.st_mode & 0777u;
  };
  for (const mode_t mask : {mode_t{0}, mode_t{022}, mode_t{077}}) {
    const mode_t before = ::umask(mask);
    EXPECT_TRUE(writeFileAtomically(folder.path() / "private", viewOf("x")).ok());
    EXPECT_TRUE(writeFileAtomically(folder.path() / "public", viewOf("x"), 0644).ok());
    auto growing = GrowingFile::create(folder.path() / "growing");
    EXPECT_TRUE(growing.ok() && growing->finish().ok());
    ::umask(before);
    EXPECT_EQ(modeOf("private"), 0600u) << mask;
    EXPECT_EQ(modeOf("public"), 0644u) << mask;
    EXPECT_EQ(modeOf("growing"), 0600u) << mask;
  }
}

TEST(PrivateFolder, isMadePrivatelyWithItsParentsAndLeftAloneIfPresent) {
  const test::TempFolder folder;
  const mode_t before = ::umask(0);
  const auto made = makePrivateFolder(folder.path() / "a" / "b/");
  fs::create_directory(folder.path() / "open");
  ::umask(before);
  ASSERT_TRUE(made.ok());
  EXPECT_TRUE(*made);
  for (const char* name : {"a", "a/b"})
    EXPECT_EQ(fs::status(folder.path() / name).permissions(), fs::perms::owner_all) << name;
  fs::create_directory_symlink("open", folder.path() / "link");
  for (const char* name : {"a/b", "a/b/", "a/.", "open", "link"}) {
    const auto there = makePrivateFolder(folder.path() / name);
    ASSERT_TRUE(there.ok()) << there.error().message;
    EXPECT_FALSE(*there) << name;
  }
  EXPECT_EQ(fs::status(folder.path() / "open").permissions(), fs::perms::all);
  const auto file = folder.write("file", "x");
  fs::create_symlink("nowhere", folder.path() / "dangling");
  for (const auto& path : {file, file / "inside", folder.path() / "dangling", fs::path()}) {
    const auto refused = makePrivateFolder(path);
    ASSERT_FALSE(refused.ok()) << path;
    EXPECT_EQ(refused.error().code, ErrorCode::kFailed);
  }
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
  fs::create_directory(target);  // a folder already has the file's name, so the rename fails
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
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(status.error().message, ::testing::HasSubstr(path.string()));
  EXPECT_FALSE(syncFolder(folder.path() / "no").ok());
}

// As root, a rename would replace /dev/null with a file for every program on the machine.
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

TEST(AtomicFile, inASharedFolderALinkIsReplacedNotItsTarget) {
  const test::TempFolder folder;
  const auto end = folder.write("end", "of the program alone");
  const auto link = folder.path() / "link", pipe = folder.path() / "pipe";
  fs::create_symlink(end, link);
  ASSERT_TRUE(replaceFileAtomically(link, viewOf("new")).ok());
  EXPECT_EQ(readWholeFile(end).value(), "of the program alone");
  EXPECT_FALSE(fs::is_symlink(link));
  EXPECT_EQ(readWholeFile(link).value(), "new");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(replaceFileAtomically(pipe, viewOf("new")).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(replaceFileAtomically(folder.path(), viewOf("new")).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(entriesIn(folder.path()), 3u);
}

TEST(Files, missingFolderAndTooLargeAreInvalidInput) {
  const test::TempFolder folder;
  for (const auto& file : {readWholeFile(folder.path() / "none"), readWholeFile(folder.path()),
                           readWholeFile(folder.write("big", "123456"), 5)}) {
    ASSERT_FALSE(file.ok());
    EXPECT_EQ(file.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(file.error().message, ::testing::HasSubstr(folder.path().string()));
  }
  EXPECT_EQ(readWholeFile(folder.path() / "big", 6).value(), "123456");
}

TEST(Files, aPipeWithoutAWriterIsRefusedAtOnce) {
  const test::TempFolder folder;
  const auto pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(readWholeFile(pipe).error().code, ErrorCode::kInvalidInput);
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
  EXPECT_EQ(entriesIn(folder.path()), 1u);
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
  EXPECT_EQ(entriesIn(folder.path()), 1u);
}

TEST(GrowingFile, whatIsNoFileIsNotReplacedByOne) {
  const test::TempFolder folder;
  for (const std::filesystem::path& there : {std::filesystem::path("/dev/null"), folder.path()}) {
    const auto file = GrowingFile::create(there);
    ASSERT_FALSE(file.ok());
    EXPECT_EQ(file.error().code, ErrorCode::kInvalidInput);
  }
  EXPECT_EQ(entriesIn(folder.path()), 0u);
}

TEST(GrowingFile, aMissingFolderIsWrongInput) {
  const test::TempFolder folder;
  const auto file = GrowingFile::create(folder.path() / "none" / "out");
  ASSERT_FALSE(file.ok());
  EXPECT_EQ(file.error().code, ErrorCode::kInvalidInput);
}

using testing::HasSubstr;

class OutputCheck : public testing::Test {
 protected:
  fs::path file(const std::string& name) {
    const fs::path path = folder_.path() / name;
    std::ofstream(path) << "x";
    return path;
  }
  [[nodiscard]] fs::path in(const std::string& name) const { return folder_.path() / name; }
  static std::string refusal(const std::vector<NamedFile>& inputs, const std::vector<NamedFile>& outputs) {
    const Status status = checkOutputs(inputs, outputs);
    if (status.ok()) return "";
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    return status.error().message;
  }
  test::TempFolder folder_;
};

TEST_F(OutputCheck, newAndOldFilesThatAreNoInputMayBeWritten) {
  EXPECT_EQ(
      refusal({{"--profile", file("p.json")}}, {{"--out", in("new.csv")}, {"--json", file("old.json")}}), "");
  EXPECT_EQ(refusal({{"--profile", file("p.json")}}, {{"--json", ""}}), "");
}

TEST_F(OutputCheck, anExistingFileIsReplacedOnlyOnRequest) {
  EXPECT_TRUE(requireNewFile({"--out", in("new.csv")}, false).ok());
  EXPECT_TRUE(requireNewFile({"--out", ""}, false).ok());
  EXPECT_TRUE(requireNewFile({"--out", "/dev/null"}, false).ok());
  const fs::path old = file("old.csv");
  EXPECT_TRUE(requireNewFile({"--out", old}, true).ok());
  const Status refused = requireNewFile({"--out", old}, false);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(refused.error().message,
            "--out " + old.string() + ": is there already; take another name, or say --replace");
}

TEST_F(OutputCheck, anInputIsNeverOverwrittenUnderAnyName) {
  const fs::path input = file("p.json");
  fs::create_symlink(input, in("link.json"));
  fs::create_hard_link(input, in("hard.json"));
  for (const fs::path& output : {input, in(".") / "p.json", in("link.json"), in("hard.json")})
    EXPECT_THAT(refusal({{"--profile", input}}, {{"--json", output}}),
                HasSubstr("is the same file as the input"))
        << output;
}

TEST_F(OutputCheck, twoOutputsAreTwoFilesBeforeEitherIsThere) {
  EXPECT_THAT(refusal({}, {{"--out", in("x.csv")}, {"--json", in(".") / "x.csv"}}),
              HasSubstr("is the same file as that of --out"));
}

TEST_F(OutputCheck, foldersAndMissingFoldersAreRefusedByName) {
  EXPECT_THAT(refusal({}, {{"--json", folder_.path()}}), HasSubstr("is a folder"));
  EXPECT_THAT(refusal({}, {{"--json", in("nodir") / "x"}}), HasSubstr("there is no folder"));
}

}  // namespace

}  // namespace needlelab

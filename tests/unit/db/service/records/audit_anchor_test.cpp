// Which files an anchor's head is read from, and which not.
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "db/audit/audit.h"
#include "db/backup/backup.h"
#include "db/service/records/record_end.h"
#include "tests/support/sanitized.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// Written out here instead of using auditHeadText().
std::string headText(int position, char digit) {
  return "audit head " + std::to_string(position) + ":" + std::string(64, digit);
}
std::string line(const std::string& action, const std::string& detail, const std::string& who = "ada",
                 const std::string& subject = "") {
  return R"({"kind":"audit","id":7,"unix_ns":1,"who":")" + who + R"(","action":")" + action +
         R"(","subject":")" + subject + R"(","detail":")" + detail + "\"}\n";
}

class AuditAnchorTest : public testing::Test {
 protected:
  /// `text`: of an export, without its last line.
  Result<AuditAnchor> read(const std::string& text) {
    const auto lines = static_cast<std::uint64_t>(std::count(text.begin(), text.end(), '\n'));
    return readAuditAnchor(
        folder.write("kept", text.starts_with('{') ? text + recordsEnd(lines, text) + "\n" : text));
  }
  std::uint64_t position(const std::string& text) {
    const auto anchor = read(text);
    EXPECT_OK(anchor);
    return anchor ? anchor->head.position : 0;
  }
  bool refused(const std::string& text) {
    const auto anchor = read(text);
    return !anchor && anchor.error().code == ErrorCode::kInvalidInput;
  }
  test::TempFolder folder;
};

TEST_F(AuditAnchorTest, aPartOfAnExportIsNoExport) {
  const std::string first = line("export-all", headText(2, 'a')), second = line("user add", "trainee");
  const std::string whole = first + second + recordsEnd(2, first + second) + "\n";
  EXPECT_OK(readAuditAnchor(folder.write("whole", whole)));
  const auto fault = [&](const std::string& text) {
    const auto anchor = readAuditAnchor(folder.write("part", text));
    return anchor ? "it was read" : anchor.error().message;
  };
  EXPECT_THAT(fault(first), HasSubstr("ends after 1 records"));
  EXPECT_THAT(fault(first + second), HasSubstr("ends after 2 records"));
  EXPECT_THAT(fault(second + recordsEnd(2, first + second) + "\n"), HasSubstr("does not agree"));
  EXPECT_THAT(fault(first + first + recordsEnd(2, first + second) + "\n"), HasSubstr("does not agree"));
  EXPECT_THAT(fault(whole + second), HasSubstr("follows the last line"));
}

TEST_F(AuditAnchorTest, anExportsHeadIsTakenFromItsOwnLine) {
  const std::string person = R"({"kind":"person","name":"anna"})"
                             "\n";
  const auto anchor = read(person + line("export-all", headText(2, 'a')) + line("user add", "trainee") +
                           line("export-all", headText(12, 'b')));
  ASSERT_OK(anchor);
  EXPECT_EQ(anchor->head.position, 12u);
  AuditKey::Hash mac{};
  mac.fill(0xbb);
  EXPECT_EQ(anchor->head.mac, mac);
  EXPECT_EQ(position(line("export-all", "with hashes of passwords and keys; " + headText(9, 'c'))), 9u);
}

TEST_F(AuditAnchorTest, aPipeIsRefusedAndNotWaitedFor) {
  const auto pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const auto anchor = readAuditAnchor(pipe);
  ASSERT_FALSE(anchor.ok());
  EXPECT_EQ(anchor.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(anchor.error().message, HasSubstr(pipe.string()));
}

TEST_F(AuditAnchorTest, aLineThatWouldFillMemoryIsRefused) {
  const std::string longest(8u << 20, 'x');
  EXPECT_EQ(position(headText(5, 'a') + "\n" + longest + "\n"), 5u);
  EXPECT_EQ(position(longest + "\n" + headText(5, 'a')), 5u);
  const auto refused_line = read(headText(5, 'a') + "\n" + longest + "x\n");
  ASSERT_FALSE(refused_line.ok());
  EXPECT_EQ(refused_line.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused_line.error().message, HasSubstr("a line of more than 8 MiB"));
}

/// The peak of this process's memory while `work` runs, in bytes.
template <typename Work>
std::uint64_t peakOfReading(const Work& work) {
  std::ofstream("/proc/self/clear_refs") << "5";
  work();
  std::ifstream in("/proc/self/status");
  std::uint64_t kib = 0;
  for (std::string of; std::getline(in, of);)
    if (of.starts_with("VmHWM:")) kib = std::stoull(of.substr(6));
  return kib << 10;
}

TEST_F(AuditAnchorTest, aLineOfBracketsTakesMemoryOfSomeTimesItsLength) {
  constexpr std::size_t kLevels = 4'000'000;
  const std::string nested = R"({"a":)" + std::string(kLevels, '[') + std::string(kLevels, ']') + "}\n";
  const std::string lines = nested + line("export-all", headText(3, 'a'));
  folder.write("kept", lines + recordsEnd(2, lines));
  Result<AuditAnchor> anchor = Error{ErrorCode::kFailed, "not read"};
  const std::uint64_t before = peakOfReading([] {});
  const std::uint64_t peak = peakOfReading([&] { anchor = readAuditAnchor(folder.path() / "kept"); });
  ASSERT_OK(anchor);
  EXPECT_EQ(anchor->head.position, 3u);
  EXPECT_TRUE(refused(R"({"a":)" + std::string(kLevels, '['))) << "no JSON";
  // a sanitizer keeps freed memory
  if (!test::kSanitized) {
    EXPECT_LT(peak - before, 25 * nested.size());
  }
}

TEST_F(AuditAnchorTest, whatSomebodyWroteIntoAnExportIsNoHead) {
  const std::string forged = headText(99, 'f');
  const std::string own = line("export-all", headText(3, 'a'));
  for (const std::string& fake :
       {line("user change", "full name: '' to '" + forged + "'"), line("user change", forged),
        line("user add", "trainee", "ada", forged), line("log-in", "", forged),
        line("export-all", "x " + forged), line("export-all", forged + " x"),
        line("export-all", forged, "ada", "eve"), line(forged, forged),
        R"({"kind":"person","name":"eve","full_name":")" + forged + "\"}\n",
        R"({"kind":"person","action":"export-all","subject":"","detail":")" + forged + "\"}\n",
        R"({"kind":"annotation","text":"\n)" + forged + R"(\n"})" + "\n"}) {
    SCOPED_TRACE(fake);
    EXPECT_EQ(position(own + fake), 3u);
    EXPECT_EQ(position(fake + own), 3u);
    EXPECT_TRUE(refused(fake)) << "alone it promises nothing";
  }
  EXPECT_TRUE(refused(own + "\n" + forged + "\n")) << "no export has such a line";
}

TEST_F(AuditAnchorTest, onlyPlainBackupsInAFolderAreAnchors) {
  test::TestDb db;
  const auto backups = folder.path() / "backups";
  std::filesystem::create_directory(backups);
  EXPECT_THAT(readAuditAnchors(backups).error().message, HasSubstr("has no plain backup"));
  for (const char* name : {"needlelab-20260102T000000Z.db", "needlelab-20260101T000000Z.db"}) {
    ASSERT_OK(AuditStore(db.writer).add({0, 1, "ada", "user add", "x", ""}));
    auto reader = db.reader();
    ASSERT_OK(backupTo(reader, backups / name));
  }
  for (const char* other : {"backups/mine.txt", "backups/needlelab-20260103T000000Z.nlbk",
                            "backups/needlelab-20260104T000000Z.db"})
    folder.write(other, "audit head 9:x");
  const auto anchors = readAuditAnchors(backups);
  ASSERT_OK(anchors);
  ASSERT_EQ(anchors->size(), 2u);
  EXPECT_EQ((*anchors)[0].name, (backups / "needlelab-20260101T000000Z.db").string());
  EXPECT_EQ((*anchors)[0].head.position, 2u);
  EXPECT_EQ((*anchors)[1].head.position, 1u);
  ASSERT_TRUE((*anchors)[0].first.has_value());
  EXPECT_EQ((*anchors)[0].first, (*anchors)[1].first);
  EXPECT_EQ(*(*anchors)[0].first, (*anchors)[1].head.mac) << "that chain has one entry";
  const auto one = readAuditAnchors(backups / "needlelab-20260102T000000Z.db");
  ASSERT_OK(one);
  ASSERT_EQ(one->size(), 1u);
  EXPECT_EQ(one->front().head.position, 1u);
}

TEST_F(AuditAnchorTest, aTextContainsOneHeadOnItsOwnLine) {
  EXPECT_EQ(position(headText(5, 'a')), 5u);
  EXPECT_EQ(position("kept on Monday\n\n  " + headText(5, 'a') + " \r\n"), 5u);
  EXPECT_EQ(
      position("as written        yes\nkeep elsewhere    " + headText(6, 'a') + "\nNothing is promised"), 6u);
  for (const std::string& none :
       {std::string(), std::string("no head"), "fault: " + headText(5, 'a'), headText(5, 'a') + "0",
        "audit head 12:" + std::string(63, 'a'), "audit head 012:" + std::string(64, 'a'),
        "audit head 1234567890123456789:" + std::string(64, 'a'), "audit head -1:" + std::string(64, 'a'),
        "audit head :" + std::string(64, 'a'), "audit head 12:" + std::string(64, 'g')}) {
    EXPECT_TRUE(refused(none)) << none;
  }
  const auto several = read(headText(5, 'a') + "\n" + headText(6, 'b') + "\n");
  ASSERT_FALSE(several);
  EXPECT_THAT(several.error().message, HasSubstr("has several heads"));
  EXPECT_EQ(readAuditAnchor(folder.path() / "none").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(readAuditAnchor(folder.path()).error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab

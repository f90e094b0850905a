// What an erasure says of backups and other databases that lie aside, also of those that somebody made to do
// harm; and what a restore of one of them erases anew.
#include "db/service/files_of_erased.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "common/wire/protocol.h"
#include "db/erasure_list.h"
#include "tests/support/fake_time.h"
#include "tests/unit/db/hot_journal.h"
#include "tests/unit/db/service/files_of_erased_fixture.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

using FilesOfErased = test::FilesOfErasedTest;

TEST_F(FilesOfErased, aJournalBesideAFileDeletesNothing) {
  addNamed("tom", "Tom Alt");
  addNamed("tim", "");
  const auto one = backup("one.db");
  const auto journal = test::writeHotJournal(one, database);
  EXPECT_THAT(filesOf("tom"), UnorderedElementsAre(one.string(), journal.string()));
  EXPECT_TRUE(fs::exists(database));
  EXPECT_TRUE(fs::exists(journal));
  EXPECT_THAT(filesOf("tim"), UnorderedElementsAre(one.string(), journal.string()));
}

TEST_F(FilesOfErased, aFileThatNeverEndsIsListedAndTheErasureIsComplete) {
  addNamed("tom", "");
  const Uuid of_tom = closedSession("tom", 1, "");
  const auto one = backup("one.db");
  const auto hostile = kept / "x.db";
  {
    auto made =
        test::TestDb::must(Connection::open(hostile, {.mode = Connection::Mode::kWriter, .create = true}));
    ASSERT_OK(
        made.script("CREATE VIEW people AS WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
                    " SELECT i AS name FROM n WHERE i < 0"));
    ASSERT_OK(made.script("PRAGMA journal_mode=DELETE"));
  }
  EXPECT_THAT(filesOf("tom"), UnorderedElementsAre(one.string(), hostile.string()));
  EXPECT_EQ(chunks(of_tom), 0u);
}

/// Puts pages into the file through which a scan of `table` comes to the same leaf without end: each page of
/// ten refers to the next one from all its places.
void makeEndless(const fs::path& file, const std::string& table) {
  std::uint32_t root = 0;
  {
    auto opened = test::TestDb::must(Connection::open(file, {}));
    auto row = opened.query("SELECT rootpage FROM sqlite_schema WHERE name = ?", table);
    ASSERT_TRUE(*row.step());
    root = row.natural32(0);
  }
  for (const char* suffix : {"-wal", "-shm"}) fs::remove(file.string() + suffix);
  constexpr std::size_t kPage_bytes = 4096;
  std::string bytes = *readWholeFile(file);
  const auto pages = static_cast<std::uint32_t>(bytes.size() / kPage_bytes);
  const auto put = [](std::string& in, std::size_t at, std::uint32_t value) {
    for (int i = 0; i < 4; ++i)
      in[at + static_cast<std::size_t>(i)] = static_cast<char>(value >> (24 - 8 * i));
  };
  std::string page = bytes.substr((root - 1) * kPage_bytes, kPage_bytes);
  ASSERT_EQ(page[0], 0x05) << "an interior page: the table has more rows than a page takes";
  const auto byteAt = [&](std::size_t at) { return static_cast<unsigned char>(page[at]); };
  const std::size_t cells = byteAt(3) * 256u + byteAt(4);
  const auto pointTo = [&](std::uint32_t child) {
    put(page, 8, child);
    for (std::size_t i = 0; i < cells; ++i) put(page, byteAt(12 + 2 * i) * 256u + byteAt(13 + 2 * i), child);
  };
  std::uint32_t last_leaf = 0;
  for (std::size_t i = 8; i < 12; ++i) last_leaf = last_leaf << 8 | byteAt(i);
  constexpr std::uint32_t kLevels = 10;
  pointTo(pages + 1);
  bytes.replace((root - 1) * kPage_bytes, kPage_bytes, page);
  for (std::uint32_t i = 1; i <= kLevels; ++i) {
    pointTo(i < kLevels ? pages + i + 1 : last_leaf);
    bytes += page;
  }
  put(bytes, 28, pages + kLevels);
  std::ofstream(file, std::ios::binary) << bytes;
}

constexpr std::int64_t kLook_ns = 1'000'000;  // what each look at a FakeTime takes
constexpr std::int64_t kTurn_ns = std::chrono::nanoseconds(kTurnOfFiles).count();

TEST_F(FilesOfErased, aTreeOfPagesWithoutEndIsGivenUpInTime) {
  addLines(5000);
  const auto one = backup("one.db");
  EXPECT_THAT(look(rowsOf("nobody")), IsEmpty());
  makeEndless(one, "audit");
  test::FakeTime time;
  time.read_cost_ns = kLook_ns;
  const std::int64_t began_ns = time.peekNs();
  EXPECT_THAT(look(rowsOf("nobody"), kMostTimeOfFiles, time), ElementsAre(one.string())) << "nobody can tell";
  EXPECT_LT(time.peekNs() - began_ns, std::chrono::nanoseconds(kMostTimeOfForeign).count() + kTurn_ns);
}

TEST_F(FilesOfErased, othersHaveTheirTurnAfterEachFileAndWithinALongOne) {
  constexpr int kLines = 5000;
  addLines(kLines);
  const auto one = backup("one.db");
  test::FakeTime time;
  time.read_cost_ns = kLook_ns;
  EXPECT_THAT(look(rowsOf("nobody"), kMostTimeOfFiles, time), IsEmpty());
  EXPECT_GE(turns, static_cast<std::uint64_t>(kLines * kLook_ns / kTurn_ns)) << "a look at the time a row";
  // a row is read to its end, and the file is opened within the turn, too: 50 steps of SQLite's a look
  constexpr std::int64_t kLooksBeside = 100;
  EXPECT_LE(longest_turn_ns, kTurn_ns + kLooksBeside * kLook_ns);
  EXPECT_EQ(opened_files, 1u) << "the rest of it is read on";
  for (const char* name : {"two.db", "three.db"}) fs::copy_file(one, kept / name);
  look(rowsOf("nobody"));
  EXPECT_EQ(opened_files, 3u);
  EXPECT_GE(turns, 3u);
}

TEST_F(FilesOfErased, aFileWithSeveralNamesIsReadOnce) {
  addNamed("tom", "");
  const auto one = backup("one.db");
  std::vector<std::string> names{one.string()};
  for (const char* name : {"a.db", "b.db", "z.db"}) {
    fs::create_hard_link(one, kept / name);
    names.push_back((kept / name).string());
  }
  EXPECT_THAT(look(rowsOf("tom")), testing::UnorderedElementsAreArray(names));
  EXPECT_EQ(opened_files, 1u);
  EXPECT_THAT(look(rowsOf("nobody")), IsEmpty());
  EXPECT_EQ(opened_files, 1u);
  // a log belongs to one name
  const std::string log = (kept / "b.db-wal").string();
  std::ofstream(log) << "frames";
  EXPECT_THAT(look(rowsOf("nobody")), ElementsAre((kept / "b.db").string(), log));
  EXPECT_EQ(opened_files, 1u);
}

TEST_F(FilesOfErased, aTextThatIsLongerThanWeStoreMakesTheFileOneOfWhichNobodyCanTell) {
  const auto one = backup("one.db");
  put(one, "INSERT INTO meta (key, value) VALUES ('long', printf('%.*c', " +
               std::to_string(kMostForeignTextBytes + 1) + ", '.'))");
  EXPECT_THAT(look(rowsOf("nobody")), ElementsAre(one.string()));
}

TEST_F(FilesOfErased, whatIsLeftWhenTheTimeIsUpIsListedUnread) {
  backup("one.db");
  EXPECT_THAT(look(rowsOf("nobody")), IsEmpty());
  EXPECT_THAT(look(rowsOf("nobody"), std::chrono::seconds(0)), ElementsAre((kept / "one.db").string()));
  EXPECT_EQ(opened_files, 0u);
}

TEST_F(FilesOfErased, areLookedAtInStepsOnceThePersonIsErased) {
  addNamed("tom", "");
  const Uuid of_tom = closedSession("tom", 1, "");
  std::vector<std::string> files;
  for (const char* name : {"one.db", "two.db", "three.db"}) files.push_back(backup(name).string());
  addPerson("eve", pb::ADMINISTRATOR);
  const Principal eve{"eve", pb::ADMINISTRATOR, true};
  const pb::Request request = erase("tom");
  RequestUnderWay under_way;
  ASSERT_FALSE(store->service().executeStep(eve, request, under_way));
  EXPECT_TRUE(under_way.isDone());
  // what she did is told, although she may no more
  ASSERT_OK(change([](Connection& c) { return c.run("UPDATE people SET disabled = 1 WHERE name = 'eve'"); }));
  std::optional<Outcome> outcome;
  int steps = 0;
  for (; !outcome; ++steps) outcome = store->service().executeStep(eve, request, under_way);
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_GE(steps, 2 + 3) << "its chunks, the log, one a file";
  EXPECT_EQ(chunks(of_tom), 0u);
  EXPECT_THAT(outcome->reply.erasure().files(), testing::UnorderedElementsAreArray(files));
}

// The finding: what an erased person could still do ended only when everybody's remarks had been searched.
TEST_F(FilesOfErased, thePersonsAccessEndsBeforeTheListBesideTheBackupsAndWhatIsLeftAreLookedAt) {
  addNamed("tom", "");
  backup("one.db");
  // an id that has the name stays, and the reply says so
  ASSERT_OK(change([](Connection& c) {
    return c.run("INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns) VALUES (?,?,1,?,1)",
                 "of-tom", "Class", "ada");
  }));
  const pb::Request request = erase("tom");
  RequestUnderWay under_way;
  ASSERT_FALSE(store->service().executeStep(admin, request, under_way));
  EXPECT_TRUE(under_way.isDone());
  EXPECT_FALSE(std::filesystem::exists(kept / kErasuresCopy));
  std::optional<Outcome> outcome;
  while (!outcome) outcome = store->service().executeStep(admin, request, under_way);
  ASSERT_FALSE(outcome->error) << outcome->error->message;
  EXPECT_TRUE(std::filesystem::exists(kept / kErasuresCopy));
  EXPECT_THAT(outcome->reply.erasure().text(), HasSubstr("of-tom"));
}

TEST_F(FilesOfErased, areThoseThatHaveThePersonUnderAnotherName) {
  const auto nobody = backup("nobody.db");
  const Uuid of_anna = closedSession("Anna Ohm", 1, "");
  const auto before = backup("before.db");
  addNamed("anna.ohm", "Anna Ohm");
  give(of_anna, "anna.ohm");
  const auto after = backup("after.db");
  EXPECT_THAT(filesOf("anna.ohm"), UnorderedElementsAre(before.string(), after.string()));
  EXPECT_EQ(chunks(of_anna), 0u);
  EXPECT_THAT(text, HasSubstr("not under one that stations gave"));
  EXPECT_GE(restore(after), 1u);
  EXPECT_EQ(chunks(of_anna), 0u);
  EXPECT_THAT(everything(), testing::Not(HasSubstr("Anna Ohm")));
  EXPECT_TRUE(store->service().erasuresToRepeat()->empty());
  // the name is free again, also after a start
  restore(nobody);
  const Uuid of_another = closedSession("Anna Ohm", 2, "");
  store.reset();
  store = test::openStore(folder.path() / "data");
  EXPECT_EQ(chunks(of_another), 3u);
}

// The list knows a person by the account's name alone: by a given name a restore, or a start after a kill,
// took a namesake's sessions.
TEST_F(FilesOfErased, aGivenNameIsNotOnTheListButInTheFiles) {
  addNamed("anna.ohm", "");
  const Uuid hers = closedSession("Anna", 1, ""), of_another = closedSession("Anna", 2, "");
  const auto before = backup("before.db");
  give(hers, "anna.ohm");
  EXPECT_THAT(filesOf("anna.ohm"), ElementsAre(before.string()));
  EXPECT_EQ(readErasures(folder.path() / "data")->size(), 1u);
  restore(before);
  EXPECT_EQ(chunks(of_another), 3u) << "another person's";
}

TEST_F(FilesOfErased, areThoseWithARemarkOrANoteOnly) {
  addNamed("ben", "");
  closedSession("ben", 1, "as good as carla, says Carla Zwick");
  const auto remark = backup("remark.db");
  ASSERT_OK(change([](Connection& c) -> Status {
    RETURN_IF_ERROR(c.run("DELETE FROM annotations"));
    return c.run(
        "INSERT INTO consents (person, given, unix_ns, recorded_by, note)"
        " VALUES ('ben', 1, 1, 'ada', 'as carla said')");
  }));
  const auto note = backup("note.db");
  ASSERT_OK(change([](Connection& c) { return c.run("DELETE FROM consents"); }));
  backup("none.db");
  addNamed("carla", "Carla Zwick");
  EXPECT_THAT(filesOf("carla"), UnorderedElementsAre(remark.string(), note.string()));
}

// By those who may write beside the backups: the reply was larger than a frame, and nobody learned the list.
TEST_F(FilesOfErased, areNamedInAReplyThatIsSentHoweverManyLieThere) {
  constexpr int kCopies = 3000;
  addNamed("tom", "");
  const auto one = backup("one.db");
  const auto tail = std::string(220, 'x') + ".partial";
  for (int i = 0; i < kCopies; ++i) std::ofstream(kept / (std::to_string(100'000 + i) + tail)) << '.';
  std::ofstream(kept / "0 \xff\n.partial") << '.';  // no message can have this name as it is
  pb::Reply reply = get(admin, erase("tom"));
  EXPECT_LT(reply.ByteSizeLong(), kMaxFrameBytes / 2);
  pb::Reply read;
  ASSERT_TRUE(read.ParseFromString(reply.SerializeAsString()));
  const auto& erasure = read.erasure();
  ASSERT_EQ(static_cast<std::size_t>(erasure.files_size()), kMostFilesNamed);
  EXPECT_EQ(erasure.files(0), one.string());
  EXPECT_EQ(erasure.files(1), (kept / "0 ??.partial").string());
  const auto others_in = [&](int named) {
    return std::to_string(kCopies + 2 - named) + " others in " + kept.string();
  };
  EXPECT_THAT(erasure.text(), HasSubstr(others_in(erasure.files_size())));
  // a reply that is lost can be asked for again
  pb::Request lines;
  lines.mutable_list_audit()->set_action("person erase");
  const auto noted = get(admin, lines).audit().entries(0);
  EXPECT_EQ(noted.subject(), erasure.pseudonym());
  EXPECT_THAT(noted.detail(), HasSubstr(one.string() + ", "));
  EXPECT_THAT(noted.detail(), testing::MatchesRegex(".*, and [0-9]+ others in " + kept.string()));
}

TEST_F(FilesOfErased, theLineOfTheAuditLogDoesNotNameThePerson) {
  addNamed("tom", "");
  backup("tom.db");
  filesOf("tom");
  EXPECT_THAT(text, HasSubstr((kept / "tom.db").string()));
  pb::Request lines;
  lines.mutable_list_audit()->set_action("person erase");
  EXPECT_THAT(get(admin, lines).audit().entries(0).detail(),
              testing::MatchesRegex(".*/erased-[0-9a-f]{12}\\.db"));
}

TEST_F(FilesOfErased, thatNobodyHasRoomForAreCountedByFolder) {
  const auto many = static_cast<int>(kMostFilesNamed) + 20;
  const auto folders = static_cast<int>(kMostFoldersCounted) + 5;
  const fs::path own = folder.path() / "data" / "backups";
  for (int i = 0; i < many; ++i) {
    fs::create_directories(own / std::to_string(i % folders));
    std::ofstream(own / std::to_string(i % folders) / (std::to_string(i) + ".partial")) << '.';
  }
  EXPECT_EQ(look(rowsOf("nobody")).size(), kMostFilesNamed);
  EXPECT_LE(others.size(), kMostFoldersCounted + 1);
  std::uint64_t counted = 0;
  for (const auto& [in, count] : others) counted += count;
  EXPECT_EQ(counted, 20u);
}

TEST_F(FilesOfErased, aListBesideTheBackupsThatCannotBeWrittenIsSaid) {
  addNamed("tom", "");
  backup("one.db");
  fs::remove(kept / kErasuresCopy);
  fs::create_directories(kept / kErasuresCopy / "in the way");
  filesOf("tom");
  EXPECT_THAT(text, HasSubstr("the list of erasures beside the backups could not be written"));
  EXPECT_THAT(text, HasSubstr((kept / kErasuresCopy).string()));
}

}  // namespace
}  // namespace needlelab

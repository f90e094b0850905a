// What `audit verify` finds: each test changes the database as somebody could who has its file, but not the
// key.
#include "db/audit_chain.h"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "common/base/files.h"
#include "db/audit.h"
#include "db/backup.h"
#include "db/erasure.h"
#include "db/people.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class AuditChainTest : public testing::Test {
 protected:
  /// Adds a line; returns its number.
  std::int64_t add(const std::string& who, const std::string& action, const std::string& subject,
                   const std::string& detail = "") {
    EXPECT_OK(AuditStore(db.writer).add({0, ++now, who, action, subject, detail}));
    auto row = db.writer.prepare("SELECT max(id) FROM audit");
    EXPECT_TRUE(*row.step());
    return row.integer(0);
  }
  void addLines(int count) {
    for (int i = 0; i < count; ++i) add("ada", "user add", "person-" + std::to_string(i), "trainee");
  }
  AuditVerdict verify(const std::vector<AuditAnchor>& anchors = {}, const std::vector<AuditKey>& more = {}) {
    auto keys = more;
    keys.push_back(test::TestDb::must(AuditKey::ofFile(db.folder.path() / kAuditKeyFile)));
    return test::TestDb::must(verifyAudit(db.writer, keys, anchors));
  }
  std::vector<std::string> faults(const std::vector<AuditAnchor>& anchors = {}) {
    return verify(anchors).texts;
  }
  AuditAnchor anchor() { return {"the anchor", *AuditChain(db.writer).head()}; }
  /// A line that says of another that its break was looked into.
  std::int64_t acknowledge(std::int64_t line, const AuditHead& entry, const std::string& who = "local:ada") {
    return add(who, kAuditAcknowledge, "line " + std::to_string(line), auditHeadText(entry));
  }
  AuditHead addBreak(std::int64_t& line) {
    line = add("local", kAuditBreak, "", "the log had 9 entries");
    return *AuditChain(db.writer).head();
  }
  /// As somebody does who has the file: no rule of the schema holds.
  void tamper(const std::string& sql) { ASSERT_OK(db.writer.script(test::lawless(sql))); }

  test::TestDb db;
  std::int64_t now = 1'700'000'000'000'000'000;
};

TEST_F(AuditChainTest, aLogAsItWasWrittenHasNoFaults) {
  addLines(3);
  const auto verdict = verify({anchor()});
  EXPECT_THAT(verdict.texts, IsEmpty());
  EXPECT_TRUE(verdict.ok());
  EXPECT_EQ(verdict.lines, 3u);
  EXPECT_EQ(verdict.head.position, 3u);
  EXPECT_EQ(verdict.head.mac, anchor().head.mac);
}

TEST_F(AuditChainTest, aChangeOfEachFieldIsFoundAndNamesItsLine) {
  addLines(3);
  for (const auto& [column, value] :
       std::vector<std::pair<std::string, std::string>>{{"unix_ns", "unix_ns + 1"},
                                                        {"who", "'eve'"},
                                                        {"action", "'user remove'"},
                                                        {"subject", "'person-9'"},
                                                        {"detail", "'trainee '"}}) {
    SCOPED_TRACE(column);
    tamper("BEGIN; UPDATE audit SET " + column + " = " + value + " WHERE id = 2");
    EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 2:")));
    tamper("ROLLBACK");
  }
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(AuditChainTest, anIndexWithEntriesThatNoRowHasHidesNothing) {
  addLines(3);
  // each connection reads the schema anew
  const auto with = [&](const std::string& sql) {
    auto writer = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(
        writer.script("PRAGMA foreign_keys=OFF; PRAGMA ignore_check_constraints=ON;"
                      "PRAGMA writable_schema=ON;" +
                      sql));
  };
  auto newSchema = [n = 1000]() mutable { return fmt::format("; PRAGMA schema_version={}", n++); };
  // an entry of line 2 that seems to be later, and one of line 4, which has none
  with(
      "INSERT INTO audit_chain VALUES (1000, 2, NULL, zeroblob(32), zeroblob(8), zeroblob(32)),"
      " (1001, 4, NULL, zeroblob(32), zeroblob(8), zeroblob(32));"
      "CREATE TABLE kept AS SELECT * FROM sqlite_schema WHERE name = 'audit_chain_lines';"
      "DELETE FROM sqlite_schema WHERE name = 'audit_chain_lines'" +
      newSchema());
  with("DELETE FROM audit_chain WHERE position >= 1000; INSERT INTO sqlite_schema SELECT * FROM kept" +
       newSchema());
  with(
      "DROP TABLE kept; UPDATE audit SET who = 'eve', detail = 'nothing' WHERE id = 2;"
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail)"
      " VALUES (4, 5, 'ada', 'user add', 'mallory', '')");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 2: its who"), HasSubstr("line 4: nothing proves it")));
}

TEST_F(AuditChainTest, textsThatMoveFromOneFieldToTheNextAreAChange) {
  add("ada", "user add", "kurt", "trainee");
  tamper("UPDATE audit SET subject = 'kurtt', detail = 'rainee' WHERE id = 1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 1:")));
}

TEST_F(AuditChainTest, aChangeOfTheProofItselfIsFound) {
  addLines(3);
  const std::string hash = test::zerosSql(32);
  std::vector<std::string> changes = {"salt = " + hash,
                                      "salt = NULL",
                                      "commitment = " + hash,
                                      "mac = " + hash,
                                      "key_id = " + test::zerosSql(8),
                                      "line = 3"};
  // PostgreSQL's CHECK holds against everybody
  if (!test::onPostgres()) changes.push_back("mac = " + test::bytesSql(""));
  for (const std::string& change : changes) {
    SCOPED_TRACE(change);
    tamper("BEGIN; UPDATE audit_chain SET " + change + " WHERE position = 2");
    EXPECT_FALSE(verify().ok());
    tamper("ROLLBACK");
  }
  EXPECT_TRUE(verify().ok());
}

TEST_F(AuditChainTest, linesThatChangedPlacesAreFound) {
  addLines(4);
  // with their proofs
  tamper(
      "UPDATE audit SET id = -id WHERE id IN (2, 3); UPDATE audit SET id = 5 + id WHERE id < 0;"
      "UPDATE audit_chain SET line = 5 - line WHERE line IN (2, 3)");
  EXPECT_FALSE(verify().ok());
  tamper(
      "UPDATE audit_chain SET position = 1000 + position WHERE position IN (2, 3);"
      "UPDATE audit_chain SET position = 1005 - position WHERE position > 1000");
  EXPECT_FALSE(verify().ok());
}

TEST_F(AuditChainTest, aLineRemovedInTheMiddleIsFound) {
  addLines(4);
  tamper("DELETE FROM audit WHERE id = 2");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 2 was removed")));
  tamper("DELETE FROM audit_chain WHERE line = 2");
  EXPECT_THAT(faults(), testing::Contains(HasSubstr("entries 2 to 2 are missing")));
  // nor when the numbers are closed up
  tamper("UPDATE audit_chain SET position = position - 1 WHERE position > 2");
  EXPECT_FALSE(verify().ok());
}

TEST_F(AuditChainTest, aLineRemovedAtTheBeginningIsFound) {
  addLines(3);
  tamper("DELETE FROM audit WHERE id = 1; DELETE FROM audit_chain WHERE position = 1");
  EXPECT_FALSE(verify().ok());
  tamper("UPDATE audit_chain SET position = position - 1");
  EXPECT_FALSE(verify().ok());
}

TEST_F(AuditChainTest, removalOfTheEndIsFoundBeforeTheAnchorAndNotBehindIt) {
  addLines(3);
  const auto kept = anchor();
  addLines(2);
  tamper("DELETE FROM audit WHERE id > 4; DELETE FROM audit_chain WHERE position > 4");
  EXPECT_THAT(faults({kept}), IsEmpty()) << "what was written behind the anchor is promised to nobody";
  EXPECT_EQ(verify({kept}).head.position, 4u);
  tamper("DELETE FROM audit WHERE id > 2; DELETE FROM audit_chain WHERE position > 2");
  EXPECT_THAT(faults(), IsEmpty()) << "without an anchor";
  EXPECT_THAT(faults({kept}), ElementsAre(HasSubstr("ends with entry 2, and had 3")));
  // nor by lines that the server itself writes afterwards
  addLines(2);
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_THAT(faults({kept}), ElementsAre(HasSubstr("entry 3 is another one now")));
}

TEST_F(AuditChainTest, anAnchorHoldsAgainstThoseWhoHaveTheKey) {
  addLines(2);
  const auto kept = anchor();
  tamper("DELETE FROM audit_chain; DELETE FROM audit");
  addLines(2);  // by the folder's own key
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_THAT(faults({kept}), ElementsAre(HasSubstr("entry 2 is another one now")));
}

TEST_F(AuditChainTest, aLineForgedWithoutTheKeyIsFound) {
  addLines(2);
  tamper(
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES (3, 1, 'eve', 'user add', 'x', "
      "'')");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 3: nothing proves it")));
  // with a proof by another key, in another folder
  const test::TempFolder elsewhere;
  ASSERT_OK(writeFileAtomically(elsewhere.path() / "own.key", viewOf(std::string(32, 'e'))));
  const auto real = db.folder.path() / kAuditKeyFile, aside = db.folder.path() / "aside";
  std::filesystem::rename(real, aside);
  std::filesystem::copy_file(elsewhere.path() / "own.key", real);
  ASSERT_OK(AuditChain(db.writer).append(3));
  std::filesystem::remove(real);
  std::filesystem::rename(aside, real);
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 3: is of another key")));
  // who says that it is the real key's, cannot make its MAC
  tamper("UPDATE audit_chain SET key_id = (SELECT key_id FROM audit_chain WHERE position = 1)");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 3:")));
}

TEST_F(AuditChainTest, anAcknowledgedBreakIsNoFaultAndSaysByWhomAndWhen) {
  addLines(2);
  std::int64_t line = 0;
  const AuditHead entry = addBreak(line);
  const std::int64_t broken_unix_ns = now;
  EXPECT_THAT(faults(), ElementsAre("line 3: the log had 9 entries"));
  ASSERT_EQ(verify().breaks.size(), 1u);
  EXPECT_EQ(verify().breaks[0].acknowledged_by, "");
  acknowledge(line, entry);
  const std::int64_t acknowledged_unix_ns = now;
  acknowledge(line, entry, "local:eve");  // the first one stays
  const auto verdict = verify();
  EXPECT_THAT(verdict.texts, IsEmpty());
  ASSERT_EQ(verdict.breaks.size(), 1u);
  EXPECT_EQ(verdict.breaks[0].line, 3);
  EXPECT_EQ(verdict.breaks[0].unix_ns, broken_unix_ns);
  EXPECT_EQ(verdict.breaks[0].detail, "the log had 9 entries");
  EXPECT_EQ(verdict.breaks[0].acknowledged_by, "local:ada");
  EXPECT_EQ(verdict.breaks[0].acknowledged_unix_ns, acknowledged_unix_ns);
  // another entry of the same line, as an erasure adds it, makes no other break of it
  ASSERT_OK(AuditChain(db.writer).amend(line, true));
  EXPECT_THAT(faults(), IsEmpty());
  EXPECT_EQ(verify().breaks.size(), 1u);
}

TEST_F(AuditChainTest, anAcknowledgementThatIsRepeatedOrForgedHidesNoOtherBreak) {
  std::int64_t first = 0, second = 0;
  const AuditHead first_entry = addBreak(first);
  const std::int64_t said = acknowledge(first, first_entry);
  EXPECT_THAT(faults(), IsEmpty());
  const AuditHead second_entry = addBreak(second);
  const std::string open = "line " + std::to_string(second) + ": the log had 9 entries";
  EXPECT_THAT(faults(), ElementsAre(open));
  // the same again, of the other line with this one's entry, and of this one with the other's
  acknowledge(first, first_entry);
  acknowledge(second, first_entry);
  acknowledge(first, second_entry);
  acknowledge(second, {second_entry.position, first_entry.mac});
  add("local:ada", kAuditAcknowledge, "line " + std::to_string(second), auditHeadText(second_entry) + " ");
  add("local:ada", "audit acknowledged", "line " + std::to_string(second), auditHeadText(second_entry));
  EXPECT_THAT(faults(), ElementsAre(open));
  // one that somebody without the key makes of another line, or of nothing
  tamper("BEGIN; UPDATE audit SET subject = 'line " + std::to_string(second) + "', detail = '" +
         auditHeadText(second_entry) + "' WHERE id = " + std::to_string(said));
  EXPECT_THAT(faults(), testing::Contains(open));
  tamper("ROLLBACK");
  tamper(
      "BEGIN; INSERT INTO audit (id, unix_ns, who, action, subject, detail)"
      " VALUES ((SELECT max(id) + 1 FROM audit), 1, 'x', '" +
      std::string(kAuditAcknowledge) + "', 'line " + std::to_string(second) + "', '" +
      auditHeadText(second_entry) + "')");
  EXPECT_THAT(faults(), testing::Contains(open));
  tamper("ROLLBACK");
  // the right one
  acknowledge(second, second_entry);
  EXPECT_THAT(faults(), IsEmpty());
}

TEST_F(AuditChainTest, aChainThatWasBegunAnewIsNamedByABackupOfBeforeWhateverItsLength) {
  addLines(3);
  auto backup = anchor();
  backup.first = test::TestDb::must(AuditChain(db.writer).firstMac());
  addLines(2);
  EXPECT_THAT(faults({backup}), IsEmpty());
  tamper("DELETE FROM audit_chain");
  for (int lines = 0; lines < 4; ++lines) {
    addLines(1);  // the first begins another chain
    EXPECT_THAT(faults({backup}), testing::Contains(HasSubstr("the anchor: this chain begins after it")));
    EXPECT_EQ(verify().faults, 5u) << "nothing proves the lines from before";
  }
  // also a shorter one, with lines gone
  tamper("DELETE FROM audit_chain; DELETE FROM audit");
  EXPECT_THAT(faults({backup}), ElementsAre(HasSubstr("the log ends with entry 0, and had 3")));
  addLines(1);
  EXPECT_THAT(faults({backup}), ElementsAre(HasSubstr("the anchor: this chain begins after it")));
}

TEST_F(AuditChainTest, linesOfAnEarlierKeyAreProvenByIt) {
  addLines(2);
  const auto first = test::TestDb::must(AuditKey::ofFolder(db.folder.path()));
  std::filesystem::remove(db.folder.path() / kAuditKeyFile);  // lost: the log goes on
  addLines(1);
  EXPECT_EQ(verify().faults, 2u);
  EXPECT_THAT(verify({}, {first}).texts, IsEmpty());
}

TEST_F(AuditChainTest, anErasureTakesTheNameAndLeavesTheEvidence) {
  ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1, "Anna Berg"}));
  add("ada", "user add", "anna", "trainee");
  add("ada", "user change", "anna", "full name: '' to 'Anna Berg'");
  add("ada", "user add", "ben", "trainee");
  const auto kept = anchor();
  const auto salts = [&](const std::string& condition) {
    auto row = db.writer.prepare("SELECT count(*) FROM audit_chain WHERE " + condition);
    EXPECT_TRUE(*row.step());
    return row.integer(0);
  };
  const ErasureLine line{"erased-1234", PseudonymKey::ofFolder(db.folder.path())->nameHash("anna"), 5};
  ASSERT_OK(ErasureStore(db.writer).erase("anna", line, "ada", "", 5));
  const auto verdict = verify({kept});
  EXPECT_THAT(verdict.texts, IsEmpty());
  EXPECT_EQ(verdict.lines, 3u);
  EXPECT_EQ(verdict.head.position, 5u) << "one more for each changed line";
  EXPECT_EQ(test::dump(db.writer).find("anna"), std::string::npos);
  EXPECT_EQ(salts("salt IS NULL AND position <= 2"), 2) << "nobody can try names against the commitments";
  EXPECT_EQ(salts("salt IS NULL"), 2);
  // an erasure is no excuse for other changes
  tamper("UPDATE audit SET subject = 'erased-9999' WHERE id = 1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 1:")));
  tamper(
      "UPDATE audit SET subject = 'erased-1234' WHERE id = 1; UPDATE audit_chain SET salt = NULL WHERE line "
      "= 3;"
      "UPDATE audit SET subject = 'erased-1234' WHERE id = 3");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 3: its salt was removed")));
}

TEST_F(AuditChainTest, anErasureSignsNoLineThatSomebodyChangedAndTakesTheNameAllTheSame) {
  ASSERT_OK(PeopleStore(db.writer).add({"anna", pb::TRAINEE, "", false, 1}));
  add("mona", "user passwd", "root");
  add("ada", "user add", "anna", "trainee");
  add("ada", "user add", "ben", "trainee");
  const ErasureLine line{"erased-1234", PseudonymKey::ofFolder(db.folder.path())->nameHash("anna"), 5};
  for (const std::string& change : std::vector<std::string>{
           "UPDATE audit SET who = 'ina', subject = 'anna' WHERE id = 1",
           "UPDATE audit SET detail = 'anna, administrator' WHERE id = 2",
           "UPDATE audit SET unix_ns = unix_ns + 1 WHERE id = 2",
           "UPDATE audit SET action = 'user change' WHERE id = 2",
           "UPDATE audit_chain SET mac = " + test::zerosSql(32) + " WHERE position = 1",
           "UPDATE audit_chain SET key_id = " + test::zerosSql(8) + " WHERE position = 2",
           "UPDATE audit_chain SET salt = NULL WHERE position = 2",
           "UPDATE audit SET subject = 'anna' WHERE id = 1; DELETE FROM audit_chain WHERE position = 1",
           "UPDATE audit_chain SET position = position + 1 WHERE position = 3;"
           "UPDATE audit_chain SET position = 3 WHERE position = 2"}) {
    SCOPED_TRACE(change);
    tamper("BEGIN; " + change);
    EXPECT_FALSE(verify().ok());
    ASSERT_OK(ErasureStore(db.writer).erase("anna", line, "ada", "", 5));
    EXPECT_FALSE(verify().ok());
    EXPECT_EQ(test::dump(db.writer).find("anna"), std::string::npos);
    tamper("ROLLBACK");
  }
  // nor does a second one
  ASSERT_OK(PeopleStore(db.writer).add({"zoe", pb::TRAINEE, "", false, 1}));
  tamper("UPDATE audit SET who = 'zoe', subject = 'anna' WHERE id = 1");
  ASSERT_OK(ErasureStore(db.writer).erase("anna", line, "ada", "", 5));
  EXPECT_EQ(AuditChain(db.writer).head()->position, 4u) << "one more for line 2";
  const ErasureLine other{"erased-5678", PseudonymKey::ofFolder(db.folder.path())->nameHash("zoe"), 5};
  ASSERT_OK(ErasureStore(db.writer).erase("zoe", other, "ada", "", 5));
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 1: its salt was removed")));
  EXPECT_EQ(AuditChain(db.writer).head()->position, 4u);
}

TEST_F(AuditChainTest, aBackupIsAnAnchorAndARestoredOneIsSound) {
  addLines(3);
  const auto file = db.folder.path() / "backup.db";
  {
    auto reader = db.reader();
    ASSERT_OK(backupTo(reader, file));
  }
  auto restored = test::TestDb::must(Connection::open(file, {}));
  const AuditAnchor backup{"the backup", *AuditChain(restored).head()};
  EXPECT_EQ(backup.head.position, 3u);
  EXPECT_EQ(backup.head.mac, anchor().head.mac);
  addLines(2);
  const auto later = anchor();
  EXPECT_THAT(faults({backup, later}), IsEmpty());
  // the restored backup: sound in itself, and the lines behind it are gone
  const auto key = test::TestDb::must(AuditKey::ofFile(db.folder.path() / kAuditKeyFile));
  EXPECT_TRUE(verifyAudit(restored, std::vector{key}, std::vector{backup})->ok());
  EXPECT_THAT(verifyAudit(restored, std::vector{key}, std::vector{later})->texts,
              ElementsAre(HasSubstr("lines were removed, or an older backup was restored")));
}

// The proofs were made by another program (Python's hashlib), as db/README.md describes them.
TEST_F(AuditChainTest, theChainIsTheOneThatItsPageDescribes) {
  ASSERT_OK(db.writer.script(
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES"
      " (1, 10, 'ada', 'user add', 'anna', 'trainee'), (2, 20, 'ada', 'user add', 'ben', ''),"
      " (3, 30, 'ina', 'consent', 'ben', 'yes')"));
  const auto entry = [](int line, const char* salt, const char* commitment, const char* mac) {
    return fmt::format("INSERT INTO audit_chain VALUES ({0}, {0}, {1}, {2}, {3}, {4});", line,
                       test::bytesSql(salt), test::bytesSql(commitment), test::bytesSql("c1019f455ac71485"),
                       test::bytesSql(mac));
  };
  ASSERT_OK(db.writer.script(entry(1, "0101010101010101010101010101010101010101010101010101010101010101",
                                   "6e98fc5c0a6154c58efd8a287a0ac9789924512bf0bb70ec582a6326ed5f7ee0",
                                   "3b677cff2d44175103fb5328703bda44eec6e76ec7e6d2bd757f9df0b5b99e61") +
                             entry(2, "0202020202020202020202020202020202020202020202020202020202020202",
                                   "ef355ce24f5f3d7e5de3485cfaef8bbeb83e330eb60148649a6152e8a2b351cc",
                                   "cbcc11a7f7adb2185f44f1e0f63a17eab8f94aeb9ef0ff1b4e22adf2a13aa705") +
                             entry(3, "0303030303030303030303030303030303030303030303030303030303030303",
                                   "63383352e32a2aae131393538497c2474d89facc5c3f3dab8e2a9b50111154e1",
                                   "2dafce27f3cb9befaad3092282ba9f058129506634d04f5a1afb3a48dbdaf2ba")));
  AuditKey::Hash bytes{};
  bytes.fill(1);
  const auto verdict = verifyAudit(db.writer, std::vector{AuditKey(bytes)}, {});
  ASSERT_OK(verdict);
  EXPECT_THAT(verdict->texts, IsEmpty());
  EXPECT_EQ(verdict->lines, 3u);
}

TEST_F(AuditChainTest, aKeyThatIsNoneIsRefusedByName) {
  const test::TempFolder folder;
  const auto key = folder.path() / kAuditKeyFile;
  EXPECT_EQ(AuditKey::ofFile(key).error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(std::filesystem::exists(key)) << "reading makes no key";
  ASSERT_OK(AuditKey::ofFolder(folder.path()));
  EXPECT_EQ(std::filesystem::status(key).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  ASSERT_OK(writeFileAtomically(key, viewOf("short")));
  EXPECT_EQ(AuditKey::ofFolder(folder.path()).error().code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace needlelab

// What `audit verify` finds: each test changes the database as somebody with its file, but without the key,
// could.
#include "db/audit/audit_chain.h"

#include <fmt/core.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "db/audit/audit.h"
#include "db/backup/backup.h"
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
  /// A line that acknowledges the break at another line.
  std::int64_t acknowledge(std::int64_t line, const AuditHead& entry, const std::string& who = "local:ada") {
    return add(who, kAuditAcknowledge, "line " + std::to_string(line), auditHeadText(entry));
  }
  AuditHead addBreak(std::int64_t& line) {
    line = add("local", kAuditBreak, "", "the log had 9 entries");
    return *AuditChain(db.writer).head();
  }
  /// Like somebody who has the file: the schema's rules do not apply.
  void tamper(const std::string& sql) { ASSERT_OK(db.writer.script(test::lawless(sql))); }

  test::TestDb db;
  std::int64_t now = 1'700'000'000'000'000'000;
};

TEST_F(AuditChainTest, anUntouchedLogHasNoFaults) {
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
  // each connection rereads the schema
  const auto with = [&](const std::string& sql) {
    auto writer = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(
        writer.script("PRAGMA foreign_keys=OFF; PRAGMA ignore_check_constraints=ON;"
                      "PRAGMA writable_schema=ON;" +
                      sql));
  };
  auto newSchema = [n = 1000]() mutable { return fmt::format("; PRAGMA schema_version={}", n++); };
  // an entry for line 2 that appears to be later, and one for line 4, which has none
  with(
      "INSERT INTO audit_chain VALUES (1000, 2, zeroblob(8), zeroblob(32)),"
      " (1001, 4, zeroblob(8), zeroblob(32));"
      "CREATE TABLE kept AS SELECT * FROM sqlite_schema WHERE name = 'audit_chain_lines';"
      "DELETE FROM sqlite_schema WHERE name = 'audit_chain_lines'" +
      newSchema());
  with("DELETE FROM audit_chain WHERE position >= 1000; INSERT INTO sqlite_schema SELECT * FROM kept" +
       newSchema());
  with(
      "DROP TABLE kept; UPDATE audit SET who = 'eve', detail = 'nothing' WHERE id = 2;"
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail)"
      " VALUES (4, 5, 'ada', 'user add', 'mallory', '')");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 2: is not as it was written"),
                                    HasSubstr("line 4: nothing proves it")));
}

TEST_F(AuditChainTest, textsThatMoveFromOneFieldToTheNextAreAChange) {
  add("ada", "user add", "kurt", "trainee");
  tamper("UPDATE audit SET subject = 'kurtt', detail = 'rainee' WHERE id = 1");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 1:")));
}

TEST_F(AuditChainTest, aChangeOfTheProofItselfIsFound) {
  addLines(3);
  const std::string hash = test::zerosSql(32);
  std::vector<std::string> changes = {"mac = " + hash, "key_id = " + test::zerosSql(8), "line = 3"};
  // PostgreSQL's CHECK applies to everybody
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
  // together with their proofs
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
  // nor if the numbers are closed up
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

TEST_F(AuditChainTest, aRemovedEndIsDetectedUpToTheAnchor) {
  addLines(3);
  const auto kept = anchor();
  addLines(2);
  tamper("DELETE FROM audit WHERE id > 4; DELETE FROM audit_chain WHERE position > 4");
  EXPECT_THAT(faults({kept}), IsEmpty()) << "lines behind the anchor are not promised";
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
  addLines(2);  // with the folder's own key
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
  // claiming the real key's id does not help to make its MAC
  tamper("UPDATE audit_chain SET key_id = (SELECT key_id FROM audit_chain WHERE position = 1)");
  EXPECT_THAT(faults(), ElementsAre(HasSubstr("line 3:")));
}

TEST_F(AuditChainTest, anAcknowledgedBreakIsNoFaultAndNamesWhoAndWhen) {
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
}

TEST_F(AuditChainTest, anAcknowledgementThatIsRepeatedOrForgedHidesNoOtherBreak) {
  std::int64_t first = 0, second = 0;
  const AuditHead first_entry = addBreak(first);
  const std::int64_t said = acknowledge(first, first_entry);
  EXPECT_THAT(faults(), IsEmpty());
  const AuditHead second_entry = addBreak(second);
  const std::string open = "line " + std::to_string(second) + ": the log had 9 entries";
  EXPECT_THAT(faults(), ElementsAre(open));
  // the same again, for the other line with this one's entry, and for this one with the other's
  acknowledge(first, first_entry);
  acknowledge(second, first_entry);
  acknowledge(first, second_entry);
  acknowledge(second, {second_entry.position, first_entry.mac});
  add("local:ada", kAuditAcknowledge, "line " + std::to_string(second), auditHeadText(second_entry) + " ");
  add("local:ada", "audit acknowledged", "line " + std::to_string(second), auditHeadText(second_entry));
  EXPECT_THAT(faults(), ElementsAre(open));
  // one forged without the key, for another line or for none
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

TEST_F(AuditChainTest, anOlderBackupRevealsARestartedChain) {
  addLines(3);
  auto backup = anchor();
  backup.first = test::TestDb::must(AuditChain(db.writer).firstMac());
  addLines(2);
  EXPECT_THAT(faults({backup}), IsEmpty());
  tamper("DELETE FROM audit_chain");
  for (int lines = 0; lines < 4; ++lines) {
    addLines(1);  // the first one begins another chain
    EXPECT_THAT(faults({backup}), testing::Contains(HasSubstr("the anchor: this chain begins after it")));
    EXPECT_EQ(verify().faults, 5u) << "nothing proves the lines from before";
  }
  // also a shorter one, with lines missing
  tamper("DELETE FROM audit_chain; DELETE FROM audit");
  EXPECT_THAT(faults({backup}), ElementsAre(HasSubstr("the log ends with entry 0, and had 3")));
  addLines(1);
  EXPECT_THAT(faults({backup}), ElementsAre(HasSubstr("the anchor: this chain begins after it")));
}

TEST_F(AuditChainTest, linesOfAnEarlierKeyAreProvenByIt) {
  addLines(2);
  const auto first = test::TestDb::must(AuditKey::ofFolder(db.folder.path()));
  std::filesystem::remove(db.folder.path() / kAuditKeyFile);  // lost: the log continues
  addLines(1);
  EXPECT_EQ(verify().faults, 2u);
  EXPECT_THAT(verify({}, {first}).texts, IsEmpty());
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
  // the restored backup is consistent in itself, but the later lines are missing
  const auto key = test::TestDb::must(AuditKey::ofFile(db.folder.path() / kAuditKeyFile));
  EXPECT_TRUE(verifyAudit(restored, std::vector{key}, std::vector{backup})->ok());
  EXPECT_THAT(verifyAudit(restored, std::vector{key}, std::vector{later})->texts,
              ElementsAre(HasSubstr("lines were removed, or an older backup was restored")));
}

// The proofs were made by another program (Python's hashlib), following db/README.md.
TEST_F(AuditChainTest, theChainIsTheOneThatItsPageDescribes) {
  ASSERT_OK(db.writer.script(
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES"
      " (1, 10, 'ada', 'user add', 'anna', 'trainee'), (2, 20, 'ada', 'user add', 'ben', ''),"
      " (3, 30, 'ina', 'consent', 'ben', 'yes')"));
  const auto entry = [](int line, const char* mac) {
    return fmt::format("INSERT INTO audit_chain VALUES ({0}, {0}, {1}, {2});", line,
                       test::bytesSql("c1019f455ac71485"), test::bytesSql(mac));
  };
  ASSERT_OK(db.writer.script(entry(1, "5f2ad25eb5a786805cc51671f72bca171af6510879069b9bd10e6333a63a75f2") +
                             entry(2, "583ae3409e45ba3c6be0b227f4e73e421f83c78330f99f6c9413fb6e8d666b6b") +
                             entry(3, "843a85946789ef68eebd884447b95c33455694b999fb5c8ec2ec02defb020bc4")));
  AuditKey::Hash bytes{};
  bytes.fill(1);
  const auto verdict = verifyAudit(db.writer, std::vector{AuditKey(bytes)}, {});
  ASSERT_OK(verdict);
  EXPECT_THAT(verdict->texts, IsEmpty());
  EXPECT_EQ(verdict->lines, 3u);
}

TEST_F(AuditChainTest, anInvalidKeyIsRefusedByName) {
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

TEST(AuditStore, listsNewestFirstAndIsNeverStoppedByItsText) {
  test::TestDb db;
  AuditStore audit(db.writer);
  ASSERT_OK(audit.add({0, 10, "bea", "user add", "anna", "trainee"}));
  ASSERT_OK(audit.add({0, 20, "\xff\xfe", "x", std::string(999, 'a') + "é and more", "z"}));
  const auto list = audit.list(0);
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].who, "(2 bytes that are not text)");
  EXPECT_EQ((*list)[0].subject, std::string(999, 'a') + "…");  // cut before the character that did not fit
  EXPECT_EQ((*list)[1].detail, "trainee");
  EXPECT_EQ(audit.list(1)->size(), 1u);
}

}  // namespace
}  // namespace needlelab

// Tampering with the audit log in the database, without a key, while the server was down or running: the head
// kept beside the database reveals it. And what a restore may legitimately do.
#include "db/audit/audit_head.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files/files.h"
#include "db/audit/audit.h"
#include "db/backup/backup.h"
#include "db/service/folder/data_folder.h"
#include "tests/unit/db/service/test_service.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using test::TestDb;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t kNow = 1'800'000'000'000'000'000;

class AuditHeadTest : public testing::Test {
 protected:
  [[nodiscard]] fs::path data() const { return folder.path() / "data"; }
  [[nodiscard]] fs::path database() const { return data() / "needlelab.db"; }
  [[nodiscard]] StoreAddress address() const {
    return {database(), test::onPostgres() ? test::postgresUrlOf(data()) : ""};
  }
  /// Starts a server that writes this many lines, and ends it.
  void serve(int lines = 0) const {
    const auto store = test::openStore(data());
    ASSERT_OK(store->writer().run([&](Connection& writer) -> Status {
      for (int i = 0; i < lines; ++i)
        RETURN_IF_ERROR(AuditStore(writer).add({0, 1, "ada", "user add", "x", ""}));
      return {};
    }));
  }
  void tamper(const std::string& sql) const {
    auto writer = TestDb::must(openAt(address(), Connection::Mode::kWriter));
    ASSERT_OK(writer.script(test::lawless(sql)));
  }
  [[nodiscard]] std::vector<AuditKey> keys() const {
    return {TestDb::must(AuditKey::ofFile(data() / kAuditKeyFile))};
  }
  [[nodiscard]] StoredAuditHead kept() const {
    return TestDb::must(readStoredAuditHead(data() / kAuditHeadFile, keys()));
  }
  /// As `audit verify` without anchors.
  [[nodiscard]] AuditVerdict verify() const {
    auto reader = TestDb::must(openAt(address(), Connection::Mode::kReader));
    const std::vector<AuditAnchor> own = {{kAuditHeadFile, kept().head}};
    return TestDb::must(verifyAudit(reader, keys(), own));
  }
  test::TempFolder folder;
  test::PostgresBelow dropped_at_end{folder.path()};
};

TEST_F(AuditHeadTest, theHeadIsStoredAtStartEndAndRequest) {
  {
    const auto store = test::openStore(data());
    EXPECT_EQ(kept().head.position, 0u);
    EXPECT_EQ(kept().made_position, 0u);
    ASSERT_OK(store->service().notes().note("x", "backup", "b", ""));
    EXPECT_EQ(kept().head.position, 0u);
    ASSERT_OK(store->storeAuditHead());
    EXPECT_EQ(kept().head.position, 1u);
    ASSERT_OK(store->service().notes().note("x", "backup", "b", ""));
  }
  EXPECT_EQ(kept().head.position, 2u);
  EXPECT_EQ(kept().head.mac, verify().head.mac);
  EXPECT_THAT(verify().texts, IsEmpty());
  using fs::perms;
  EXPECT_EQ(fs::status(data() / kAuditHeadFile).permissions(), perms::owner_read | perms::owner_write);
}

TEST_F(AuditHeadTest, aLinePutAmongTheOthersIsFound) {
  serve(3);
  for (const char* id : {"0", "-5"}) {
    SCOPED_TRACE(id);
    tamper(std::string("INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES (") + id +
           ", 1, 'eve', 'consent', 'anna', '')");
    EXPECT_THAT(verify().texts,
                testing::ElementsAre(HasSubstr(std::string("line ") + id + ": nothing proves it")));
    serve(1);
    EXPECT_FALSE(verify().ok());
    tamper(std::string("DELETE FROM audit WHERE id = ") + id);
    EXPECT_TRUE(verify().ok());
  }
}

TEST_F(AuditHeadTest, aRemovedChainIsStillDetectedAfterARestart) {
  serve(3);
  tamper("DELETE FROM audit_chain; UPDATE audit SET who = 'eve' WHERE id = 2");
  EXPECT_THAT(verify().texts, AllOf(Contains(HasSubstr("line 2: nothing proves it")),
                                    Contains(HasSubstr("audit.head: the log ends with entry 0, and had 3"))));
  serve();  // reports the finding
  EXPECT_THAT(verify().texts, AllOf(Contains(HasSubstr("line 2: nothing proves it")),
                                    Contains(HasSubstr("the log had 3 entries"))));
  serve(2);
  EXPECT_EQ(verify().faults, 4u) << "the three lines, and the break: once, and for ever";
  EXPECT_EQ(verify().lines, 3u);
  // its line cannot be removed again
  tamper("DELETE FROM audit WHERE id >= 4; DELETE FROM audit_chain WHERE line >= 4");
  EXPECT_THAT(verify().texts, Contains(HasSubstr("audit.head: the log ends with entry 0, and had 3")));
}

TEST_F(AuditHeadTest, aChainTakenAwayUnderARunningServerIsFound) {
  {
    const auto store = test::openStore(data());
    for (int i = 0; i < 3; ++i) ASSERT_OK(store->service().notes().note("x", "backup", "b", ""));
    ASSERT_OK(store->storeAuditHead());
    tamper("DELETE FROM audit_chain");
    ASSERT_OK(store->service().notes().note("x", "backup", "b", ""));  // begins another chain
    ASSERT_OK(store->storeAuditHead());
    EXPECT_EQ(kept().head.position, 3u) << "the head from before stays";
    EXPECT_THAT(verify().texts, Contains(HasSubstr("audit.head: the log ends with entry 1, and had 3")));
  }
  serve();
  EXPECT_THAT(verify().texts, Contains(HasSubstr("the log had 3 entries")));
}

TEST_F(AuditHeadTest, aManuallyRestoredCopyIsDetectedButNotARestore) {
  serve(2);
  const auto backup = folder.path() / "backup.db";
  {
    auto reader = TestDb::must(Connection::open(database(), {.mode = Connection::Mode::kReader}));
    ASSERT_OK(backupTo(reader, backup));
  }
  serve(3);
  const auto newest = kept().head;
  EXPECT_EQ(newest.position, 5u);
  ASSERT_OK(restoreFrom(data(), backup, kNow));
  serve(1);
  EXPECT_THAT(verify().texts, IsEmpty());
  EXPECT_EQ(verify().head.position, 3u);
  ASSERT_TRUE(kept().replaced.has_value());
  EXPECT_EQ(kept().replaced->position, newest.position);
  EXPECT_EQ(kept().replaced->mac, newest.mac);
  EXPECT_EQ(kept().made_position, 2u);
  // the same by hand
  for (const char* log : {"-wal", "-shm"}) fs::remove(database().string() + log);
  fs::copy_file(backup, database(), fs::copy_options::overwrite_existing);
  EXPECT_THAT(verify().texts, Contains(HasSubstr("audit.head: the log ends with entry 2, and had 3")));
  serve(1);
  EXPECT_THAT(verify().texts, testing::ElementsAre(HasSubstr("an older database was put in its place")));
}

// Both need only the file and no key, and the server itself would make proofs for what remains.
TEST_F(AuditHeadTest, forgedTriggersAreDetectedByVerifyStartAndBackup) {
  serve(1);
  tamper(
      "CREATE TRIGGER forge AFTER INSERT ON audit BEGIN UPDATE audit SET who = 'mona' WHERE id = NEW.id; END;"
      "CREATE TRIGGER swallow AFTER INSERT ON audit_chain BEGIN"
      " DELETE FROM audit_chain WHERE position = NEW.position; DELETE FROM audit WHERE id = NEW.line; END");
  EXPECT_THAT(verify().texts, testing::ElementsAre(HasSubstr("trigger 'forge' of 'audit'"),
                                                   HasSubstr("trigger 'swallow' of 'audit_chain'")));
  const auto refused = Store::open(data(), {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(refused.error().message, HasSubstr("trigger 'forge' of 'audit'"));
  const auto backup = folder.path() / "backup.db";
  {
    auto reader = TestDb::must(Connection::open(database(), {.mode = Connection::Mode::kReader}));
    EXPECT_EQ(backupTo(reader, backup).error().code, ErrorCode::kCorrupt);
    auto writer = TestDb::must(Connection::open(database(), {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writer.run("VACUUM INTO ?", backup.string()));  // somebody else's
  }
  fs::create_directory(folder.path() / "other");
  const auto restored = restoreFrom(folder.path() / "other", backup, kNow);
  ASSERT_FALSE(restored);
  EXPECT_EQ(restored.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(restored.error().message,
              AllOf(HasSubstr(backup.string()), HasSubstr("trigger 'forge' of 'audit'")));
  tamper("DROP TRIGGER forge; DROP TRIGGER swallow");
  serve(1);
  EXPECT_THAT(verify().texts, IsEmpty());
}

TEST_F(AuditHeadTest, aForeignHeadFileIsABreakUnlikeAMissingOne) {
  serve(2);
  const std::string right = TestDb::must(readWholeFile(data() / kAuditHeadFile, 1000));
  std::string flipped = right;
  flipped[right.size() / 2] = static_cast<char>(flipped[right.size() / 2] ^ 1);
  std::uint64_t breaks = 0;
  for (const std::string& wrong : {std::string(), flipped, right.substr(0, right.size() / 2)}) {
    SCOPED_TRACE(wrong);
    folder.write("data/audit.head", wrong);
    serve();
    EXPECT_EQ(verify().faults, ++breaks);
    EXPECT_THAT(verify().texts.back(), AllOf(HasSubstr("it is unknown how far the log had come"),
                                             HasSubstr("audit.head: is not as a server")));
    serve(1);
    EXPECT_EQ(verify().faults, breaks) << "once";
  }
  // with another key: the earlier one was lost
  fs::remove(data() / kAuditKeyFile);
  serve();
  EXPECT_THAT(verify().texts.back(), HasSubstr("it is unknown how far the log had come"));
  const auto faults = verify().faults;
  fs::remove(data() / kAuditHeadFile);
  serve();
  EXPECT_EQ(verify().faults, faults) << "`verify` says so in a note";
}

// The text and its MAC were made by another program (Python's hashlib), following db/README.md.
TEST_F(AuditHeadTest, theFileMatchesItsSpecificationAndEveryByteIsProtected) {
  const std::string right =
      "needlelab audit head 1\nmade 1764000000000000000 0\n"
      "audit head 3:6c970a2ac34b855aefa0a321150f25a4754e8f875498e6a3c951758cfefce7c1\nreplaced nothing\n"
      "mac b2d4b7067c62c0f420bd1bc58027f5da3d34ee3da931b72ee49a560694adbebe\n";
  AuditKey::Hash bytes{};
  bytes.fill(1);
  const std::vector ours{AuditKey(bytes)};
  const auto read = readStoredAuditHead(folder.write("head", right), ours);
  ASSERT_OK(read);
  EXPECT_EQ(read->made_unix_ns, 1'764'000'000'000'000'000);
  EXPECT_EQ(read->made_position, 0u);
  EXPECT_EQ(read->head.position, 3u);
  EXPECT_EQ(read->head.mac[0], 0x6c);
  EXPECT_FALSE(read->replaced.has_value());
  for (std::size_t at = 0; at < right.size(); ++at) {
    std::string wrong = right;
    wrong[at] = static_cast<char>(wrong[at] ^ 1);
    const auto refused = readStoredAuditHead(folder.write("head", wrong), ours);
    ASSERT_FALSE(refused) << at;
    EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  }
  EXPECT_FALSE(readStoredAuditHead(folder.write("head", right + "x"), ours));
  EXPECT_FALSE(readStoredAuditHead(folder.write("head", ""), ours));
  bytes.fill(2);
  EXPECT_FALSE(readStoredAuditHead(folder.write("head", right), std::vector{AuditKey(bytes)}));
  EXPECT_EQ(readStoredAuditHead(folder.path() / "none", ours).error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace needlelab

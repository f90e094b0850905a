// A lab on PostgreSQL records what a restored backup proves (needlelab-admin backup verified).
#include <gmock/gmock.h>

#include "db/audit.h"
#include "db/schema.h"
#include "db/store_address.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

class VerifiedBackups : public test::ServiceTest {
 protected:
  void SetUp() override {
    addStation();
    auto reader = store->readers().borrow();
    const auto lab = MetaStore(**reader).get(kLabKey);
    ASSERT_OK(MetaStore(restored.writer).set(kLabKey, **lab));
    ASSERT_OK(change([&](Connection& c) { return put(c); }));
    ASSERT_OK(put(restored.writer));
  }
  Status put(Connection& to) const {
    SessionStore sessions(to);
    if (auto opened = sessions.open(test::describe(id), 1); !opened) return opened.error();
    for (std::uint64_t seq = 0; seq < 4; ++seq)
      if (auto appended = sessions.append(id, seq, test::chunkOf(seq)); !appended) return appended.error();
    return {};
  }
  static pb::Request verified(const std::string& path, bool counts_as_safe) {
    pb::Request request;
    request.mutable_backup()->set_path(path);
    request.mutable_backup()->set_counts_as_safe(counts_as_safe);
    return request;
  }
  /// The test databases' address as a URL, which the request wants.
  [[nodiscard]] std::string restoredUrl() const {
    const std::string& text = restored.address.url;
    const auto value = [&](const std::string& name) {
      const auto at = text.find(name + "=") + name.size() + 1;
      return text.substr(at, text.find(' ', at) - at);
    };
    return "postgresql://" + value("user") + "@/" + value("dbname") + "?host=" + value("host");
  }
  std::uint64_t safe() {
    auto reader = store->readers().borrow();
    return *SessionStore(**reader).safeSeqs(id);
  }
  test::TestDb restored;
  const Uuid id = makeUuidV7();
};

TEST_F(VerifiedBackups, aRestoredBackupMakesChunksSafeWhereThatIsAskedFor) {
  const auto unasked = get(admin, verified(restoredUrl(), false)).backup_done();
  EXPECT_EQ(unasked.chunks_verified(), 4u);
  EXPECT_EQ(unasked.disk(), pb::BackupDone::DISK_UNKNOWN);
  EXPECT_FALSE(unasked.safe());
  EXPECT_EQ(safe(), 0u);
  const auto asked = get(admin, verified(restoredUrl(), true)).backup_done();
  EXPECT_TRUE(asked.safe());
  EXPECT_EQ(safe(), 3u) << "the session is open: its last chunk stays at the station";
  pb::Request audit;
  audit.mutable_list_audit()->set_action("backup");
  const auto lines = get(admin, audit).audit();
  ASSERT_EQ(lines.entries_size(), 2);
  EXPECT_THAT(lines.entries(0).detail(), HasSubstr("4 chunks, Safe because it was asked for"));
  EXPECT_THAT(lines.entries(1).detail(), HasSubstr("not Safe"));
}

TEST_F(VerifiedBackups, whatIsNoRestoredDatabaseIsRefusedWithTheRemedy) {
  const auto said = [&](const pb::Request& request) {
    const Outcome outcome = ask(admin, request);
    EXPECT_TRUE(outcome.error.has_value());
    return outcome.error ? outcome.error->message : "";
  };
  EXPECT_THAT(said(verified("/var/backups/needlelab.db", true)),
              HasSubstr("needlelab-admin backup verified"));
  pb::Request kept = verified(restoredUrl(), true);
  kept.mutable_backup()->set_keep(3);
  EXPECT_THAT(said(kept), HasSubstr("needlelab-admin backup verified"));
  EXPECT_THAT(said(verified("postgresql://ada:secret@/lab?host=/tmp", true)), HasSubstr("password"));
  EXPECT_THAT(said(verified(restoredUrl() + "-nowhere", true)), HasSubstr("postgres"));
  EXPECT_EQ(safe(), 0u);
  EXPECT_EQ(refusal(manager, verified(restoredUrl(), true)), ErrorCode::kDenied);
}

}  // namespace
}  // namespace needlelab

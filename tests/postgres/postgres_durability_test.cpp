// What a successfully returned commit survives, on a cluster that waits for a standby which never answers.
#include <gmock/gmock.h>

#include <chrono>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "db/engine/open_postgres.h"
#include "db/sessions/db_writer.h"
#include "db/store/connection.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

class PostgresDurability : public testing::Test {
 protected:
  PostgresDurability() {
    must(control_->script("DROP TABLE IF EXISTS kept; CREATE TABLE kept (id BIGINT PRIMARY KEY)"));
  }
  ~PostgresDurability() override { setStandbys(""); }

  static std::unique_ptr<EngineConnection> open(Durability least = Durability::kNothing) {
    const char* cluster = std::getenv("NEEDLELAB_TEST_POSTGRES");
    if (cluster == nullptr) throw std::runtime_error("NEEDLELAB_TEST_POSTGRES is not set");
    auto opened = openPostgres({.url = std::string(cluster) + " dbname=postgres",
                                .answer_timeout = std::chrono::milliseconds(1500),
                                .least = least});
    if (!opened) throw std::runtime_error(opened.error().message);
    must((*opened)->script("SET search_path TO public"));
    return std::move(*opened);
  }
  static void must(const Status& status) {
    if (!status) throw std::runtime_error(status.error().message);
  }
  static std::string textOf1(EngineConnection& on, const std::string& sql) {
    auto statement = on.prepare(sql);
    if (!statement) throw std::runtime_error(statement.error().message);
    const auto stepped = (*statement)->step();
    if (!stepped) throw std::runtime_error(stepped.error().message);
    return *stepped ? std::string(textOf((*statement)->bytes(0))) : "";
  }
  /// For the whole cluster, at once.
  void setStandbys(const std::string& names) {
    must(control_->script("ALTER SYSTEM SET synchronous_standby_names = '" + names + "'"));
    must(control_->script("SELECT pg_reload_conf()"));
    while (textOf1(*control_, "SELECT current_setting('synchronous_standby_names')") != names)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  /// Once a commit waits for the standby: cancels the wait, as an administrator may.
  void cancelTheWait() { atTheWait("pg_cancel_backend"); }
  /// Once a commit waits for the standby: calls this PostgreSQL function with its backend's process id.
  void atTheWait(const std::string& function) {
    for (;;) {
      if (textOf1(*control_, "SELECT count(*)::text FROM (SELECT " + function +
                                 "(pid) FROM pg_stat_activity WHERE wait_event = 'SyncRep') AS waits") != "0")
        return;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  static Status put(EngineConnection& on, const std::string& sql) {
    if (Status begun = on.begin(EngineConnection::Begin::kWrite); !begun) return begun;
    if (Status done = on.script(sql); !done) return done;
    return on.commit();
  }

  std::unique_ptr<EngineConnection> control_ = open();
};

TEST_F(PostgresDurability, aCommitWithoutAStandbySurvivesAPowerCut) {
  const auto db = open();
  ASSERT_TRUE(put(*db, "INSERT INTO kept VALUES (1)").ok());
  EXPECT_EQ(db->durability(), Durability::kPowerCut);
  EXPECT_THAT(db->durabilityReason(), HasSubstr("fsync = on"));
  ASSERT_TRUE(db->script("SET synchronous_commit = off").ok());
  ASSERT_TRUE(put(*db, "INSERT INTO kept VALUES (2)").ok());
  EXPECT_EQ(db->durability(), Durability::kNothing);
}

TEST_F(PostgresDurability, aWaitForTheStandbyThatSomebodyCancelsIsNoSuccess) {
  const auto db = open();
  setStandbys("ANY 1 (b)");
  std::thread canceller([this] { cancelTheWait(); });
  const Status stored = put(*db, "INSERT INTO kept VALUES (1)");
  canceller.join();
  ASSERT_FALSE(stored.ok());
  EXPECT_EQ(stored.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(stored.error().message, HasSubstr("at the primary only"));
  EXPECT_EQ(db->durability(), Durability::kDiskLoss);
  EXPECT_EQ(textOf1(*control_, "SELECT id::text FROM kept"), "1") << "it is still there";
}

// The finding: this ended the wait without a warning, and the ack was a broken promise.
TEST_F(PostgresDurability, removingAllStandbysDuringAWaitFailsTheCommit) {
  setStandbys("ANY 1 (b)");
  const auto db = open(Durability::kDiskLoss);
  std::thread administrator([this] {
    while (textOf1(*control_, "SELECT count(*)::text FROM pg_stat_activity WHERE wait_event = 'SyncRep'") ==
           "0")
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    setStandbys("");
  });
  const std::uint64_t before = db->roundTrips();
  const Status stored = put(*db, "INSERT INTO kept VALUES (1)");
  administrator.join();
  EXPECT_EQ(db->roundTrips() - before, 3u) << "BEGIN, INSERT, COMMIT; the settings come with that";
  ASSERT_FALSE(stored.ok());
  EXPECT_EQ(stored.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(stored.error().message, HasSubstr("at the primary only"));
  EXPECT_EQ(textOf1(*control_, "SELECT id::text FROM kept"), "1") << "it is still there";
}

TEST_F(PostgresDurability, aCommitThatReadsTheSettingsKeepsItsErrors) {
  must(
      control_->script("DROP TABLE IF EXISTS later; CREATE TABLE later"
                       " (id BIGINT UNIQUE DEFERRABLE INITIALLY DEFERRED)"));
  setStandbys("ANY 1 (b)");
  const auto db = open(Durability::kDiskLoss);
  const Status twice = put(*db, "INSERT INTO later VALUES (1), (1)");
  ASSERT_FALSE(twice.ok()) << "COMMIT itself refuses it";
  EXPECT_EQ(twice.error().code, ErrorCode::kAlreadyExists);
  EXPECT_FALSE(db->inTransaction());

  must(db->begin(EngineConnection::Begin::kWrite));
  EXPECT_FALSE(db->script("INSERT INTO kept VALUES (1), (1)").ok());
  const Status failed = db->commit();
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::kFailed);
  EXPECT_THAT(failed.error().message, HasSubstr("had failed, and was rolled back"));

  std::thread canceller([this] { cancelTheWait(); });
  const Status cancelled = put(*db, "INSERT INTO kept VALUES (2)");
  canceller.join();
  ASSERT_FALSE(cancelled.ok());
  EXPECT_THAT(cancelled.error().message, HasSubstr("stored at the primary only: "));

  std::thread terminator([this] { atTheWait("pg_terminate_backend"); });
  const Status lost = put(*db, "INSERT INTO kept VALUES (3)");
  terminator.join();
  ASSERT_FALSE(lost.ok());
  EXPECT_EQ(lost.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(lost.error().message, HasSubstr("it is unknown whether the standby has it, too"))
      << "it was asked for";
  EXPECT_EQ(textOf1(*control_, "SELECT string_agg(id::text, ' ' ORDER BY id) FROM kept"), "2 3");
  EXPECT_EQ(textOf1(*control_, "SELECT count(*)::text FROM later"), "0");
}

TEST_F(PostgresDurability, aServerThatComesBackWithAllThatWasAcknowledgedLacksNothing) {
  const auto db = open();
  ASSERT_TRUE(put(*db, "INSERT INTO kept VALUES (1)").ok());
  must(
      control_->script("SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
                       " WHERE backend_type = 'client backend' AND pid <> pg_backend_pid()"));
  // the first transaction meets the lost connection, or finds it lost before it begins
  if (!put(*db, "INSERT INTO public.kept VALUES (2)").ok()) db->rollback();
  const Status again = put(*db, "INSERT INTO public.kept VALUES (3)");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(db->lack(), "");
}

// The finding: a new primary with the old one's settings left no line in the log.
TEST_F(PostgresDurability, isReportedAtStartOnReconnectionAndOnChange) {
  std::vector<Durability> told;  // on the writer's thread, before run() returns
  DbWriter::Options options;
  options.window = std::chrono::milliseconds(0);
  options.on_durability = [&](Durability now, const std::string& /*reason*/) { told.push_back(now); };
  DbWriter writer(Connection(open(), "needlelab.db"), options, {});
  std::int64_t id = 0;
  const auto store = [&] {
    return writer.run(
        [&](Connection& connection) { return connection.run("INSERT INTO public.kept VALUES (?)", ++id); });
  };
  EXPECT_TRUE(store().ok() && store().ok());
  std::vector<Durability> wanted = {Durability::kPowerCut};
  EXPECT_EQ(told, wanted) << "at the start, once";
  for (int round = 0; round < 2; ++round) {
    must(
        control_->script("SELECT pg_terminate_backend(pid) FROM pg_stat_activity"
                         " WHERE backend_type = 'client backend' AND pid <> pg_backend_pid()"));
    // the first transaction meets the lost connection, or finds it lost before it begins
    if (!store().ok()) EXPECT_EQ(told, wanted) << "no server answers yet";
    EXPECT_TRUE(store().ok() && store().ok());
    wanted.push_back(Durability::kPowerCut);
    EXPECT_EQ(told, wanted) << "at a reconnection, once";
  }
  must(control_->script("ALTER SYSTEM SET full_page_writes = off"));
  must(control_->script("SELECT pg_reload_conf()"));
  while (told.size() == wanted.size() && store().ok()) continue;
  wanted.push_back(Durability::kProcess);
  EXPECT_TRUE(store().ok());
  EXPECT_EQ(told, wanted) << "when it changes, once";
  must(control_->script("ALTER SYSTEM RESET full_page_writes"));
  must(control_->script("SELECT pg_reload_conf()"));
}

TEST_F(PostgresDurability, aReadOnlyTransactionWaitsOnlyForThePrimary) {
  const auto db = open();
  setStandbys("ANY 1 (b)");
  std::thread canceller([this] { cancelTheWait(); });
  EXPECT_FALSE(put(*db, "INSERT INTO kept VALUES (1)").ok());
  canceller.join();
  must(db->begin(EngineConnection::Begin::kWriteSoon));
  EXPECT_EQ(db->commit().ok(), false) << "that asks nothing, either";
  // like a chunk that its station sends again: it is there, nothing is written, and an ack would be a promise
  const Status again = put(*db, "INSERT INTO kept VALUES (1) ON CONFLICT DO NOTHING");
  ASSERT_FALSE(again.ok());
  EXPECT_EQ(again.error().code, ErrorCode::kUnavailable);
}

TEST_F(PostgresDurability, nothingIsStoredWhileAnAckWouldSurviveLessThanItMust) {
  setStandbys("ANY 1 (b)");
  const auto db = open(Durability::kDiskLoss);
  setStandbys("");
  const Status refused = put(*db, "INSERT INTO kept VALUES (1)");
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.error().message, HasSubstr("must survive the loss of a disk"));
  EXPECT_FALSE(db->inTransaction());
  EXPECT_EQ(textOf1(*control_, "SELECT count(*)::text FROM kept"), "0");
  // also if that becomes known only together with the statement
  must(db->begin(EngineConnection::Begin::kWriteSoon));
  auto insert = db->prepare("INSERT INTO kept VALUES (1)");
  ASSERT_TRUE(insert.ok());
  const auto stored = (*insert)->step();
  ASSERT_FALSE(stored.ok());
  EXPECT_THAT(stored.error().message, HasSubstr("must survive the loss of a disk"));
  EXPECT_FALSE(db->inTransaction() || db->commit().ok());
  db->rollback();
  EXPECT_EQ(textOf1(*control_, "SELECT count(*)::text FROM kept"), "0");
  // any standby that connects, possibly on the primary's disk
  setStandbys("*");
  EXPECT_FALSE(put(*db, "INSERT INTO kept VALUES (1)").ok());
  EXPECT_EQ(db->durability(), Durability::kPowerCut);
}

}  // namespace
}  // namespace needlelab

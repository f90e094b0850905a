// The engine on a cluster started by tests/postgres/cluster; NEEDLELAB_TEST_POSTGRES names it.
#include "db/engine/postgres.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "db/engine/open_postgres.h"

namespace needlelab {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::string urlOf(const std::string& database) {
  const char* cluster = std::getenv("NEEDLELAB_TEST_POSTGRES");
  if (cluster == nullptr) throw std::runtime_error("NEEDLELAB_TEST_POSTGRES is not set");
  return std::string(cluster) + " dbname=" + database;
}

/// A separate database with the table `kinds`.
class PostgresEngine : public testing::Test {
 protected:
  PostgresEngine() : control_(connect("postgres")) {
    must(control_->script("DROP DATABASE IF EXISTS " + name_));
    must(control_->script("CREATE DATABASE " + name_));
    db = connect(name_);
    must(db->script(
        "CREATE SCHEMA needlelab;"
        "CREATE TABLE kinds (id BIGINT PRIMARY KEY, real DOUBLE PRECISION, text TEXT, bytes BYTEA)"));
  }
  ~PostgresEngine() override {
    db.reset();
    (void)control_->script("DROP DATABASE IF EXISTS " + name_ + " WITH (FORCE)");
  }
  static std::unique_ptr<EngineConnection> connect(const std::string& database, bool read_only = false) {
    auto opened = openPostgres({.url = urlOf(database), .read_only = read_only});
    if (!opened) throw std::runtime_error(opened.error().message);
    return std::move(*opened);
  }
  static void must(const Status& status) {
    if (!status) throw std::runtime_error(status.error().message);
  }
  static std::unique_ptr<EngineStatement> prepared(EngineConnection& on, const std::string& sql) {
    auto statement = on.prepare(sql);
    if (!statement) throw std::runtime_error(statement.error().message);
    return std::move(*statement);
  }
  static Status run(EngineConnection& on, const std::string& sql) {
    auto statement = prepared(on, sql);
    const auto stepped = statement->step();
    return stepped ? Status() : Status(stepped.error());
  }
  Status add(std::int64_t id) {
    return run(*db, "INSERT INTO kinds (id) VALUES (" + std::to_string(id) + ")");
  }
  static std::int64_t number(EngineConnection& on, const std::string& sql) {
    auto statement = prepared(on, sql);
    const auto stepped = statement->step();
    EXPECT_TRUE(stepped && *stepped) << sql;
    return stepped && *stepped ? statement->integer(0) : -1;
  }
  std::int64_t count() { return number(*db, "SELECT count(*) FROM kinds"); }
  static std::string textOfColumn(const EngineStatement& row, int column) {
    return std::string(textOf(row.bytes(column)));
  }
  std::string otherName() const { return name_; }

  std::unique_ptr<EngineConnection> control_;
  const std::string name_ = "engine" + std::to_string(::getpid());
  std::unique_ptr<EngineConnection> db;
};

TEST_F(PostgresEngine, keepsValuesThatAreUnboundAsNullAndNoByteZeroInText) {
  auto insert = prepared(*db, "INSERT INTO kinds (id, text) VALUES (?, ?)");
  ASSERT_TRUE(insert->bind(1, std::int64_t{1}).ok());
  EXPECT_FALSE(*insert->step());
  EXPECT_EQ(number(*db, "SELECT count(*) FROM kinds WHERE text IS NULL"), 1);
  EXPECT_FALSE(insert->bind(2, std::string_view("a\0b", 3)).ok());
}

TEST_F(PostgresEngine, readsSumsAndTruthsAsWholeNumbers) {
  for (const std::int64_t id : {3, 4}) must(add(id));
  EXPECT_EQ(number(*db, "SELECT sum(id) FROM kinds"), 7);
  EXPECT_EQ(number(*db, "SELECT EXISTS (SELECT 1 FROM kinds)"), 1);
  EXPECT_EQ(number(*db, "SELECT length('abc')"), 3);
}

TEST_F(PostgresEngine, aParameterHasTheTypeOfItsValueEverywhere) {
  auto insert = prepared(*db, "INSERT INTO kinds (id, text) SELECT ?1 + id, ?2 FROM (SELECT 1 AS id) AS one");
  ASSERT_TRUE(insert->bind(1, std::int64_t{4}).ok() && insert->bind(2, std::string_view("a")).ok());
  ASSERT_FALSE(*insert->step());
  insert->reset();
  // the same text with another type
  ASSERT_TRUE(insert->bind(1, std::int64_t{5}).ok() && insert->bindNull(2).ok());
  ASSERT_FALSE(*insert->step());
  EXPECT_EQ(number(*db, "SELECT id FROM kinds WHERE text = 'a'"), 5);
  EXPECT_EQ(number(*db, "SELECT id FROM kinds WHERE text IS NULL"), 6);
}

TEST_F(PostgresEngine, errorsSayWhatKindTheyAre) {
  const struct {
    const char* sql;
    ErrorCode code;
  } rows[] = {
      {"SELECT 1 / 0", ErrorCode::kInvalidInput},
      {"SELECT nothing FROM nowhere", ErrorCode::kFailed},
  };
  for (const auto& row : rows) {
    const Status status = run(*db, row.sql);
    ASSERT_FALSE(status.ok()) << row.sql;
    EXPECT_EQ(status.error().code, row.code) << status.error().message;
    EXPECT_THAT(status.error().message, HasSubstr(otherName()));
  }
  EXPECT_FALSE(db->damaged() || db->inTransaction());
}

TEST_F(PostgresEngine, aDeferredSavepointRollsBackWhatFollowedIt) {
  must(db->begin(EngineConnection::Begin::kWrite));
  must(db->savepoint());  // without a statement
  must(db->releaseSavepoint());
  must(db->savepoint());
  must(add(1));
  must(db->releaseSavepoint());
  must(db->savepoint());  // removed by the earlier release
  must(add(2));
  EXPECT_FALSE(add(1).ok());
  EXPECT_FALSE(db->releaseSavepoint().ok()) << "its statement has failed";
  must(db->undoSavepoint());
  must(db->savepoint());
  EXPECT_FALSE(run(*db, "SELECT nothing FROM nowhere").ok()) << "which cannot be prepared";
  must(db->undoSavepoint());
  must(db->savepoint());
  must(db->script("INSERT INTO kinds (id) VALUES (3); INSERT INTO kinds (id) VALUES (4)"));
  must(db->undoSavepoint());
  must(db->savepoint());
  must(add(5));
  EXPECT_EQ(db->changes(), 1);
  must(db->releaseSavepoint());
  must(db->savepoint());
  must(db->undoSavepoint());
  EXPECT_EQ(count(), 2);
  must(db->commit());
  EXPECT_EQ(count(), 2);
  // a transaction that failed or is gone does not allow one
  must(db->begin(EngineConnection::Begin::kWrite));
  EXPECT_FALSE(add(1).ok());
  EXPECT_FALSE(db->savepoint().ok());
  EXPECT_FALSE(db->isLost());
  db->rollback();
  EXPECT_FALSE(db->savepoint().ok());
  db->rollback();
  EXPECT_EQ(count(), 2);
}

TEST_F(PostgresEngine, aConnectionThatIsLostBehindASavepointLosesItsTransaction) {
  must(db->begin(EngineConnection::Begin::kWrite));
  must(add(1));
  must(db->savepoint());
  must(run(*control_,
           "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" + otherName() + "'"));
  const Status lost = add(2);
  ASSERT_FALSE(lost.ok());
  EXPECT_EQ(lost.error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(db->isLost());
  must(db->undoSavepoint());
  EXPECT_FALSE(db->savepoint().ok());
  db->rollback();
  EXPECT_EQ(count(), 0);
  EXPECT_FALSE(db->damaged());
}

TEST_F(PostgresEngine, aStatementBehindASavepointIsCancelledToo) {
  must(db->begin(EngineConnection::Begin::kWrite));
  must(add(1));
  must(db->savepoint());
  std::atomic<bool> cancelled{true};
  db->setCancelled(&cancelled);
  const Status ended = run(*db, "SELECT pg_sleep(1000)");
  db->setCancelled(nullptr);
  ASSERT_FALSE(ended.ok());
  EXPECT_EQ(ended.error().code, ErrorCode::kUnavailable);
  must(db->undoSavepoint());
  must(db->commit());
  EXPECT_EQ(count(), 1);
}

TEST_F(PostgresEngine, aDeferredBeginSharesTheFirstStatementsRoundTrip) {
  const auto soon = EngineConnection::Begin::kWriteSoon;
  const auto insert = prepared(*db, "INSERT INTO kinds (id) VALUES (?)");
  const auto addSoon = [&](std::int64_t id) {
    insert->reset();
    must(insert->bind(1, id));
    const auto stepped = insert->step();
    return stepped ? Status() : Status(stepped.error());
  };
  for (std::int64_t id = 1; id <= 3; ++id) {
    must(db->begin(soon));
    EXPECT_TRUE(db->inTransaction());
    must(db->savepoint());
    const std::uint64_t before = db->roundTrips();
    must(addSoon(id));
    must(db->releaseSavepoint());
    must(db->commit());
    // the first time the statements are prepared
    EXPECT_EQ(db->roundTrips() - before, id == 1 ? 3u : 2u);
  }
  EXPECT_EQ(count(), 3);

  // no other writes in the meantime
  must(db->begin(soon));
  must(addSoon(4));
  const std::string held =
      "SELECT count(*) FROM pg_locks l JOIN pg_database d ON d.oid = l.database"
      " WHERE d.datname = '" +
      name_ + "' AND l.locktype = 'advisory' AND l.objid = " + std::to_string(kWriterLock);
  EXPECT_EQ(number(*control_, held), 1);
  db->rollback();
  EXPECT_EQ(number(*control_, held), 0);
  EXPECT_FALSE(db->inTransaction());
  EXPECT_EQ(count(), 3);
  // without statements it only begins when it ends, and is safe then
  must(db->begin(soon));
  must(db->commit());
  must(db->begin(soon));
  db->rollback();
  EXPECT_FALSE(db->inTransaction());
}

TEST_F(PostgresEngine, theWritersLockIsTheTableWhereThereIsOne) {
  const auto held = [&] {
    auto rows =
        prepared(*control_,
                 "SELECT coalesce(string_agg(l.locktype || ' ' || l.mode, ', '), '') FROM pg_locks l"
                 " JOIN pg_database d ON d.oid = l.database WHERE d.datname = '" +
                     name_ + "' AND l.mode = 'ExclusiveLock' AND l.locktype IN ('advisory', 'relation')");
    const auto stepped = rows->step();
    if (!stepped) throw std::runtime_error(stepped.error().message);
    return std::string(textOf(rows->bytes(0)));
  };
  const auto heldWithin = [&] {
    must(db->begin(EngineConnection::Begin::kWrite));
    const std::string locks = held();
    must(db->commit());
    return locks;
  };
  EXPECT_EQ(heldWithin(), "advisory ExclusiveLock");
  must(db->script(std::string("CREATE TABLE ") + kWriterTable + " (version BIGINT)"));
  // from the second one on it is known to exist
  for (int i = 0; i < 3; ++i) EXPECT_EQ(heldWithin(), "relation ExclusiveLock");
  // somebody else drops it
  must(connect(name_)->script(std::string("DROP TABLE ") + kWriterTable));
  const Status refused = db->begin(EngineConnection::Begin::kWrite);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("does not exist"));
  EXPECT_FALSE(db->inTransaction());
  EXPECT_EQ(heldWithin(), "advisory ExclusiveLock");
}

TEST_F(PostgresEngine, rollingBackTheFirstSavepointKeepsTheTransactionOpen) {
  must(db->begin(EngineConnection::Begin::kWriteSoon));
  must(db->savepoint());  // without a statement
  must(db->undoSavepoint());
  must(db->savepoint());
  must(add(1));
  must(db->undoSavepoint());
  EXPECT_TRUE(db->inTransaction());
  must(db->savepoint());
  must(add(2));
  EXPECT_FALSE(add(2).ok());
  EXPECT_FALSE(db->releaseSavepoint().ok()) << "its statement has failed";
  must(db->undoSavepoint());
  must(db->savepoint());
  must(add(3));
  must(db->releaseSavepoint());
  must(db->savepoint());  // an ordinary one
  must(add(4));
  must(db->undoSavepoint());
  EXPECT_EQ(count(), 1);
  must(db->commit());
  EXPECT_EQ(count(), 1);
  EXPECT_EQ(number(*db, "SELECT id FROM kinds"), 3);
}

TEST_F(PostgresEngine, aFailedBeginFailsEveryCallUntilRollback) {
  must(db->script("SET lock_timeout = 50"));
  const auto other = connect(otherName());
  must(other->begin(EngineConnection::Begin::kWrite));
  for (const auto kind : {EngineConnection::Begin::kWrite, EngineConnection::Begin::kWriteSoon}) {
    Status begun = db->begin(kind);
    if (kind == EngineConnection::Begin::kWriteSoon) {
      must(begun);
      must(db->savepoint());
      begun = add(1);
      EXPECT_FALSE(db->savepoint().ok() || db->script("SELECT 1").ok() || db->commit().ok());
      EXPECT_EQ(add(2).error().message, begun.error().message);
      must(db->undoSavepoint());
    }
    ASSERT_FALSE(begun.ok());
    EXPECT_EQ(begun.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(begun.error().message, HasSubstr("begin a transaction"));
    EXPECT_FALSE(db->inTransaction() || db->isLost() || db->damaged());
    if (kind == EngineConnection::Begin::kWriteSoon) db->rollback();
    EXPECT_EQ(count(), 0) << "the next statement is not affected";
  }
  other->rollback();
  must(db->begin(EngineConnection::Begin::kWriteSoon));
  must(add(1));
  must(db->commit());
  EXPECT_EQ(count(), 1);
}

TEST_F(PostgresEngine, aConnectionThatIsGoneAtTheBeginningLosesTheTransactionOnly) {
  must(db->begin(EngineConnection::Begin::kWriteSoon));
  must(db->savepoint());
  must(run(*control_,
           "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" + otherName() + "'"));
  const Status lost = add(1);
  ASSERT_FALSE(lost.ok());
  EXPECT_EQ(lost.error().code, ErrorCode::kUnavailable);
  must(db->undoSavepoint());
  EXPECT_FALSE(db->savepoint().ok() || db->commit().ok());
  db->rollback();
  EXPECT_FALSE(db->inTransaction() || db->isLost() || db->damaged());
  must(db->begin(EngineConnection::Begin::kWriteSoon));
  must(add(1));
  must(db->commit());
  EXPECT_EQ(count(), 1);
}

TEST_F(PostgresEngine, theThreadRunsGivenWorkWhileItWaits) {
  const auto sleep = prepared(*db, "SELECT pg_sleep(0.1)");
  int pieces = 0;
  const auto piecesOfOneWait = [&] {
    sleep->reset();
    pieces = 0;
    EXPECT_TRUE(sleep->step().ok());
    return pieces;
  };
  piecesOfOneWait();  // it is prepared now
  db->setWhileWaiting([&] { return ++pieces < 20; });
  EXPECT_EQ(piecesOfOneWait(), 20) << "and is not asked again in this wait";
  EXPECT_EQ(piecesOfOneWait(), 20);
  db->setWhileWaiting({});
  EXPECT_EQ(piecesOfOneWait(), 0);
}

TEST_F(PostgresEngine, aListIsOneParameter) {
  constexpr auto kMin = std::numeric_limits<std::int64_t>::min();
  const std::vector<std::int64_t> ids = {7, kMin, -1};
  const std::vector<std::string_view> texts = {"Ünï '{},\"\\", "", "NULL"};
  const Bytes some = {0, 1, 255, 0};
  const std::vector<ByteView> bytes = {some, {}, ByteView(some).first(1)};
  auto insert = prepared(*db,
                         "INSERT INTO kinds (id, text, bytes)"
                         " SELECT l.id, l.text, l.bytes FROM unnest(?, ?, ?) AS l (id, text, bytes)");
  must(insert->bindList(1, std::span<const std::int64_t>(ids)));
  must(insert->bindList(2, std::span<const std::string_view>(texts)));
  must(insert->bindList(3, std::span<const ByteView>(bytes)));
  EXPECT_FALSE(*insert->step());
  EXPECT_EQ(db->changes(), 3);
  auto rows = prepared(*db, "SELECT id, text, bytes FROM kinds ORDER BY id DESC");
  for (const std::size_t i : {0, 2, 1}) {
    ASSERT_TRUE(*rows->step());
    EXPECT_EQ(rows->integer(0), ids[i]);
    EXPECT_EQ(textOfColumn(*rows, 1), texts[i]);
    EXPECT_EQ(textOf(rows->bytes(2)), textOf(bytes[i]));
    EXPECT_FALSE(rows->isNull(1) || rows->isNull(2));
  }
  insert->reset();
  must(insert->bindList(1, std::span<const std::int64_t>()));
  must(insert->bindList(2, std::span<const std::string_view>()));
  must(insert->bindList(3, std::span<const ByteView>()));
  EXPECT_FALSE(*insert->step());
  EXPECT_EQ(count(), 3) << "empty lists are not errors";
  const std::vector<std::string_view> zero = {"a", std::string_view("a\0b", 3)};
  EXPECT_FALSE(insert->bindList(2, std::span<const std::string_view>(zero)).ok());
}

TEST_F(PostgresEngine, aTransactionWithAnErrorIsNotReportedAsCommitted) {
  must(db->begin(EngineConnection::Begin::kWrite));
  must(add(1));
  EXPECT_FALSE(add(1).ok());
  EXPECT_FALSE(db->commit().ok()) << "PostgreSQL answers ROLLBACK, which is not an error of its own";
  EXPECT_EQ(count(), 0);
}

// each adds one to the number it read: without the lock one of the two is lost
// The finding: with a faculty's address, whose primary is one of two hosts, readers could not connect.
TEST_F(PostgresEngine, aReaderFindsThePrimaryByTheSameAddressAsTheWriter) {
  auto opened = openPostgres({.url = urlOf(name_) + " target_session_attrs=read-write", .read_only = true});
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  EXPECT_TRUE((*opened)->script("SELECT count(*) FROM kinds").ok());
  EXPECT_FALSE((*opened)->script("INSERT INTO kinds (id) VALUES (1)").ok());
}

TEST_F(PostgresEngine, writersComeOneAfterAnother) {
  must(add(1));
  must(run(*db, "UPDATE kinds SET real = 0"));
  constexpr int kTimes = 50;
  const auto count_up = [](EngineConnection& on) {
    for (int i = 0; i < kTimes; ++i) {
      must(on.begin(EngineConnection::Begin::kWrite));
      const std::int64_t before = number(on, "SELECT real FROM kinds");
      must(run(on, "UPDATE kinds SET real = " + std::to_string(before + 1)));
      must(on.commit());
    }
  };
  const auto second = connect(otherName());
  std::thread other([&] { count_up(*second); });
  count_up(*db);
  other.join();
  EXPECT_EQ(number(*db, "SELECT real FROM kinds"), 2 * kTimes);
}

TEST_F(PostgresEngine, aCancelledStatementEndsAndTheConnectionGoesOn) {
  std::atomic<bool> cancelled{true};
  const auto* const before = db->setCancelled(&cancelled);
  EXPECT_EQ(before, nullptr);
  const Status ended = run(*db, "SELECT pg_sleep(1000)");
  ASSERT_FALSE(ended.ok());
  EXPECT_EQ(ended.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(db->setCancelled(nullptr), &cancelled);
  EXPECT_EQ(count(), 0);
}

TEST_F(PostgresEngine, aLostConnectionLosesItsTransactionAndTheNextOneConnectsAgain) {
  must(add(1));
  must(db->begin(EngineConnection::Begin::kWrite));
  must(add(2));
  must(run(*control_,
           "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" + otherName() + "'"));
  const Status lost = add(3);
  ASSERT_FALSE(lost.ok());
  EXPECT_EQ(lost.error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(db->isLost());
  EXPECT_TRUE(db->inTransaction()) << "until it is rolled back";
  EXPECT_FALSE(add(3).ok()) << "else half of it would be committed";
  db->rollback();
  EXPECT_FALSE(db->isLost());
  EXPECT_EQ(count(), 1);
  EXPECT_FALSE(db->damaged());
}

// otherwise its later reads would show another time than the first
TEST_F(PostgresEngine, aLostViewIsNotGoneOnWithOnANewConnection) {
  must(add(1));
  must(db->begin(EngineConnection::Begin::kView));
  EXPECT_EQ(count(), 1);
  must(run(*control_,
           "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" + otherName() + "'"));
  for (int read = 0; read < 2; ++read) {
    const Status lost = run(*db, "SELECT 1");
    ASSERT_FALSE(lost.ok());
    EXPECT_EQ(lost.error().code, ErrorCode::kUnavailable);
    EXPECT_TRUE(db->isLost());
  }
  db->rollback();
  EXPECT_EQ(count(), 1);
}

TEST_F(PostgresEngine, aStatementTakesAnyNumberOfListsOfTypes) {
  must(add(1));
  auto read = prepared(*db, "SELECT count(*) FROM kinds WHERE ? IS NULL OR ? IS NULL OR ? IS NULL");
  constexpr int kKinds = 3;  // a number, a text, bytes
  for (int round = 0; round < 2; ++round)
    for (int types = 0; types < kKinds * kKinds * kKinds; ++types) {
      for (int parameter = 1, kind = types; parameter <= 3; ++parameter, kind /= kKinds)
        must(kind % kKinds == 0   ? read->bind(parameter, std::int64_t{1})
             : kind % kKinds == 1 ? read->bind(parameter, std::string_view("a"))
                                  : read->bind(parameter, ByteView()));
      const auto row = read->step();
      ASSERT_TRUE(row.ok()) << row.error().message;
      EXPECT_EQ(read->integer(0), 0);
      read->reset();
    }
  EXPECT_EQ(number(*db,
                   "SELECT count(*) FROM pg_prepared_statements"
                   " WHERE statement LIKE 'SELECT count(*) FROM kinds%'"),
            8);
}

TEST_F(PostgresEngine, aCommitWithoutAnAnswerIsAskedForAndNeverGuessed) {
  must(db->begin(EngineConnection::Begin::kWrite));
  must(add(1));
  must(run(*control_,
           "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" + otherName() + "'"));
  const Status ended = db->commit();
  ASSERT_FALSE(ended.ok());
  EXPECT_EQ(ended.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(ended.error().message, HasSubstr("nothing was stored"));
  EXPECT_EQ(count(), 0);
}

// The finding: a second host in the address, with another lab or an older backup, was accepted.
TEST_F(PostgresEngine, connectsAgainToTheDatabaseOfItsLabOnly) {
  must(
      db->script("CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);"
                 "CREATE TABLE schema_version (version BIGINT NOT NULL);"
                 "INSERT INTO meta VALUES ('lab_id', 'lab-1'); INSERT INTO schema_version VALUES (7)"));
  struct Change {
    const char *there, *words, *back;
  };
  constexpr Change kChanges[] = {
      {"UPDATE meta SET value = 'lab-2'",
       "belongs to the lab lab-2, and this server's belongs to the lab lab-1",
       "UPDATE meta SET value = 'lab-1'"},
      {"UPDATE meta SET key = 'other'", "has no lab's id", "UPDATE meta SET key = 'lab_id'"},
      {"UPDATE schema_version SET version = 6", "has the version '6', and this server's has 7",
       "UPDATE schema_version SET version = 7"},
      {"INSERT INTO schema_version VALUES (8)", "has the version '7, 8'",
       "DELETE FROM schema_version WHERE version = 8"},
      {"ALTER TABLE meta RENAME TO elsewhere", "relation \"needlelab.meta\" does not exist",
       "ALTER TABLE elsewhere RENAME TO meta"},
  };
  for (const bool read_only : {false, true}) {
    auto opened = openPostgres({.url = urlOf(otherName()), .read_only = read_only});
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    EngineConnection& own = **opened;
    own.stayWith({.lab = "lab-1", .schema_version = 7});
    std::uint64_t connected = 1;
    for (const Change& change : kChanges) {
      const std::string pid = std::to_string(number(own, "SELECT pg_backend_pid()"));
      must(db->script(change.there));
      must(run(*control_, "SELECT pg_terminate_backend(" + pid + ")"));
      while (number(*control_, "SELECT count(*) FROM pg_stat_activity WHERE pid = " + pid) > 0)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      EXPECT_FALSE(run(own, "SELECT 1").ok()) << "the connection is lost";
      for (int again = 0; again < 2; ++again) {
        const Status other = own.begin(EngineConnection::Begin::kView);
        ASSERT_FALSE(other.ok()) << change.there;
        EXPECT_EQ(other.error().code, ErrorCode::kUnavailable);
        EXPECT_THAT(other.error().message, HasSubstr(change.words));
      }
      const auto first =
          openPostgres({.url = urlOf(otherName()), .read_only = read_only, .lab = LabIdentity{"lab-1", 7}});
      ASSERT_FALSE(first.ok()) << change.there;
      EXPECT_EQ(first.error().code, ErrorCode::kUnavailable);
      EXPECT_THAT(first.error().message, HasSubstr(change.words));
      EXPECT_EQ(own.timesConnected(), connected);
      must(db->script(change.back));
      must(run(own, "SELECT 1"));
      EXPECT_EQ(own.timesConnected(), ++connected);
      EXPECT_EQ(number(own, "SELECT (current_setting('default_transaction_read_only') = 'on')::int"),
                read_only ? 1 : 0);
    }
    EXPECT_FALSE(own.damaged());
  }
}

// PostgreSQL may keep a connection that the network has lost, and its locks, for minutes
TEST_F(PostgresEngine, theCommitsOutcomeIsKnownDespiteADeadLockHolder) {
  std::unique_ptr<EngineConnection> holder;
  const auto opened = openPostgres(
      {.url = urlOf(otherName()),
       .others = PostgresOptions::Others::kNone,
       .answer_timeout = std::chrono::seconds(2),
       .before_statement = [&](std::string_view sql) {
         if (sql != "COMMIT") return;
         must(run(*control_, "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = '" +
                                 otherName() + "'"));
         holder = connect(otherName());
         must(holder->script("SELECT pg_advisory_lock(" + std::to_string(kAloneLock) + ")"));
       }});
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  EngineConnection& alone = **opened;
  must(alone.begin(EngineConnection::Begin::kWrite));
  must(run(alone, "INSERT INTO kinds (id) VALUES (1)"));
  const Status ended = alone.commit();
  ASSERT_FALSE(ended.ok());
  EXPECT_THAT(ended.error().message, HasSubstr("nothing was stored"));
  const Status next = alone.begin(EngineConnection::Begin::kWrite);
  ASSERT_FALSE(next.ok()) << "somebody else has the store";
  EXPECT_THAT(next.error().message, HasSubstr("works on this database"));
}

PostgresOptions beside(std::string url, PostgresOptions::Others others, std::string name = {}) {
  PostgresOptions options{.url = std::move(url)};
  options.others = others;
  options.only_one_named = std::move(name);
  return options;
}

TEST_F(PostgresEngine, whoWorksAloneAndWhoWorksTogetherKeepEachOtherOut) {
  using Others = PostgresOptions::Others;
  const std::string url = urlOf(otherName());
  auto first = openPostgres(beside(url, Others::kShared, "a"));
  ASSERT_TRUE(first.ok()) << first.error().message;
  EXPECT_TRUE((*first)->isAlone()) << "until it lets others in";
  const auto early = openPostgres(beside(url, Others::kShared, "b"));
  ASSERT_FALSE(early.ok());
  EXPECT_EQ(early.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(early.error().message, HasSubstr("start that server with --together"));
  must((*first)->admitOthers());
  EXPECT_FALSE((*first)->isAlone());

  auto second = openPostgres(beside(url, Others::kShared, "b"));
  ASSERT_TRUE(second.ok()) << second.error().message;
  EXPECT_FALSE((*second)->isAlone());
  const auto same = openPostgres(beside(url, Others::kShared, "b"));
  ASSERT_FALSE(same.ok());
  EXPECT_THAT(same.error().message, HasSubstr("a server 'b' works on this database already"));
  const auto alone = openPostgres(beside(url, Others::kNone));
  ASSERT_FALSE(alone.ok());
  EXPECT_EQ(alone.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(alone.error().message, HasSubstr("end it (each, where servers work together)"));

  // while any of them exists
  first->reset();
  EXPECT_FALSE(openPostgres(beside(url, Others::kNone)).ok());
  second->reset();
  auto after = openPostgres(beside(url, Others::kNone));
  ASSERT_TRUE(after.ok()) << after.error().message;
  EXPECT_TRUE((*after)->isAlone());
}

TEST_F(PostgresEngine, aReconnectionKeepsExclusiveOrSharedAccess) {
  using Others = PostgresOptions::Others;
  const std::string url = urlOf(otherName());
  const auto cut = [&](EngineConnection& connection) {
    const std::string pid = std::to_string(number(connection, "SELECT pg_backend_pid()"));
    must(run(*control_, "SELECT pg_terminate_backend(" + pid + ", 10000)"));
  };
  auto first = openPostgres(beside(url, Others::kShared, "a"));
  ASSERT_TRUE(first.ok()) << first.error().message;
  // during work that needs exclusive access it reconnects only with exclusive access
  cut(**first);
  {
    const auto intruder = openPostgres(beside(url, Others::kShared, "b"));
    ASSERT_TRUE(intruder.ok()) << intruder.error().message;
    must((*intruder)->admitOthers());
    const Status refused = run(**first, "SELECT 1");
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  }
  must(run(**first, "SELECT 1"));
  EXPECT_TRUE((*first)->isAlone());
  must((*first)->admitOthers());
  auto second = openPostgres(beside(url, Others::kShared, "b"));
  ASSERT_TRUE(second.ok()) << second.error().message;
  cut(**first);
  must(run(**first, "SELECT 1"));
  EXPECT_FALSE((*first)->isAlone());
  EXPECT_FALSE(openPostgres(beside(url, Others::kNone)).ok());
}

// a server stopped (SIGSTOP) within a transaction must not block the others
TEST_F(PostgresEngine, aTransactionOfAProgramThatIsStoppedEndsAndStoresNothing) {
  must(db->script("CREATE TABLE schema_version (version BIGINT NOT NULL)"));
  const auto open = [&](std::chrono::milliseconds max_idle) {
    PostgresOptions options = beside(urlOf(otherName()), PostgresOptions::Others::kAll);
    options.max_idle = max_idle;
    auto opened = openPostgres(options);
    if (!opened) throw std::runtime_error(opened.error().message);
    return std::move(*opened);
  };
  const auto stopped = open(std::chrono::milliseconds(300)), other = open(std::chrono::seconds(30));
  must(stopped->begin(EngineConnection::Begin::kWrite));
  must(run(*stopped, "INSERT INTO kinds (id) VALUES (1)"));
  // waits for the store's lock until PostgreSQL has ended the other transaction
  must(other->begin(EngineConnection::Begin::kWrite));
  must(run(*other, "INSERT INTO kinds (id) VALUES (2)"));
  must(other->commit());
  const Status late = stopped->commit();
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(late.error().message, HasSubstr("nothing was stored"));
  EXPECT_EQ(number(*db, "SELECT count(*) FROM kinds WHERE id = 1"), 0);
  EXPECT_EQ(number(*db, "SELECT count(*) FROM kinds WHERE id = 2"), 1);
  // and continues
  must(stopped->begin(EngineConnection::Begin::kWrite));
  must(run(*stopped, "INSERT INTO kinds (id) VALUES (3)"));
  must(stopped->commit());
  // the same between two statements: the transaction ended with the connection
  must(stopped->begin(EngineConnection::Begin::kWrite));
  must(run(*stopped, "INSERT INTO kinds (id) VALUES (4)"));
  must(other->begin(EngineConnection::Begin::kWrite));
  other->rollback();
  EXPECT_FALSE(run(*stopped, "INSERT INTO kinds (id) VALUES (5)").ok());
  EXPECT_TRUE(stopped->isLost());
  EXPECT_FALSE(stopped->commit().ok());
  stopped->rollback();
  EXPECT_EQ(number(*db, "SELECT count(*) FROM kinds"), 2);
}

// --- notices, and writes beside the writer

TEST_F(PostgresEngine, aNoticeArrivesAfterCommitOnItsChannelOnly) {
  const auto listener = connect(otherName(), true);
  must(listener->listen("told"));
  const auto heard = [&](int patience_ms) {
    const auto notices = listener->waitForNotices(std::chrono::milliseconds(patience_ms));
    if (!notices) throw std::runtime_error(notices.error().message);
    return *notices;
  };
  EXPECT_THAT(heard(0), ElementsAre());
  must(db->begin(EngineConnection::Begin::kWrite));
  must(run(*db, "SELECT pg_notify('told', 'undone')"));
  db->rollback();
  must(run(*db, "SELECT pg_notify('other', 'elsewhere')"));
  must(db->begin(EngineConnection::Begin::kWrite));
  must(run(*db, "SELECT pg_notify('told', 'one')"));
  must(run(*db, "SELECT pg_notify('told', 'two')"));
  EXPECT_THAT(heard(50), ElementsAre()) << "not before the COMMIT";
  must(db->commit());
  EXPECT_THAT(heard(60'000), ElementsAre("one", "two"));
  // one that arrives with the answer to a statement is kept
  must(run(*db, "SELECT pg_notify('told', 'three')"));
  EXPECT_EQ(number(*listener, "SELECT 7"), 7);
  EXPECT_THAT(heard(60'000), ElementsAre("three"));
}

TEST_F(PostgresEngine, aListenerLearnsThatItsConnectionIsLost) {
  const auto listener = connect(otherName(), true);
  must(listener->listen("told"));
  const std::string pid = std::to_string(number(*listener, "SELECT pg_backend_pid()"));
  must(run(*control_, "SELECT pg_terminate_backend(" + pid + ")"));
  const auto ended = listener->waitForNotices(std::chrono::minutes(1));
  ASSERT_FALSE(ended.ok());
  EXPECT_EQ(ended.error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE(listener->waitForNotices(std::chrono::milliseconds(0)).ok()) << "it does not connect again";
  const std::uint64_t connected = listener->timesConnected();
  EXPECT_EQ(number(*listener, "SELECT 7"), 7);
  EXPECT_EQ(listener->timesConnected(), connected + 1) << "a statement does, and no one listens then";
}

TEST_F(PostgresEngine, aConnectionThatEndedIdleCausesNoError) {
  for (const auto kind :
       {EngineConnection::Begin::kView, EngineConnection::Begin::kSide, EngineConnection::Begin::kWrite}) {
    const auto pooled = connect(otherName());
    const std::uint64_t connected = pooled->timesConnected();
    const std::string pid = std::to_string(number(*pooled, "SELECT pg_backend_pid()"));
    must(run(*control_, "SELECT pg_terminate_backend(" + pid + ", 10000)"));
    must(pooled->begin(kind));
    EXPECT_EQ(number(*pooled, "SELECT 7"), 7);
    must(pooled->commit());
    EXPECT_EQ(pooled->timesConnected(), connected + 1);
    // but not one lost within a transaction
    must(pooled->begin(kind));
    EXPECT_EQ(number(*pooled, "SELECT 7"), 7);
    const std::string again = std::to_string(number(*pooled, "SELECT pg_backend_pid()"));
    must(run(*control_, "SELECT pg_terminate_backend(" + again + ", 10000)"));
    EXPECT_FALSE(run(*pooled, "SELECT 7").ok());
    pooled->rollback();
  }
}

TEST_F(PostgresEngine, aSideTransactionDoesNotWaitForTheWriter) {
  must(db->begin(EngineConnection::Begin::kWrite));
  must(add(1));
  auto opened = openPostgres({.url = urlOf(otherName()),
                              .answer_timeout = std::chrono::seconds(20),
                              .local_commits = true,
                              .server = "server-a"});
  ASSERT_TRUE(opened.ok()) << opened.error().message;
  EngineConnection& beside = **opened;
  must(beside.begin(EngineConnection::Begin::kSide));
  EXPECT_TRUE(beside.inTransaction());
  must(run(beside, "INSERT INTO kinds (id) VALUES (2)"));
  must(beside.commit());
  must(beside.begin(EngineConnection::Begin::kSide));
  must(run(beside, "INSERT INTO kinds (id) VALUES (3)"));
  beside.rollback();
  must(db->commit());
  EXPECT_EQ(count(), 2);
  EXPECT_EQ(number(beside, "SELECT (current_setting('synchronous_commit') = 'local')::int"), 1);
  EXPECT_EQ(number(beside, "SELECT (current_setting('needlelab.server') = 'server-a')::int"), 1);
  EXPECT_EQ(number(*db, "SELECT (coalesce(current_setting('needlelab.server', true), '') = '')::int"), 1);
}

TEST_F(PostgresEngine, aCommitLostBesideTheWriterIsNoSuccess) {
  const auto beside = connect(otherName());
  must(beside->begin(EngineConnection::Begin::kSide));
  must(run(*beside, "INSERT INTO kinds (id) VALUES (2)"));
  const std::string pid = std::to_string(number(*beside, "SELECT pg_backend_pid()"));
  must(run(*control_, "SELECT pg_terminate_backend(" + pid + ")"));
  const Status ended = beside->commit();
  ASSERT_FALSE(ended.ok());
  EXPECT_EQ(ended.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(count(), 0);
  must(beside->begin(EngineConnection::Begin::kSide));
  must(run(*beside, "INSERT INTO kinds (id) VALUES (2)"));
  must(beside->commit());
  EXPECT_EQ(count(), 1);
}

TEST_F(PostgresEngine, postgresqlIsSetToCheckItsClients) {
  EXPECT_EQ(number(*db,
                   "SELECT count(*) FROM pg_settings WHERE (name, reset_val) IN"
                   " (('tcp_keepalives_idle', '5'), ('tcp_keepalives_interval', '2'),"
                   " ('tcp_keepalives_count', '3'), ('tcp_user_timeout', '10000'),"
                   " ('client_connection_check_interval', '2000'))"),
            5);
}

TEST_F(PostgresEngine, noOtherRoleOfTheClusterKeepsAWriterWaiting) {
  must(db->script("CREATE TABLE schema_version (version BIGINT NOT NULL)"));
  const std::string role = otherName() + "_role";
  must(control_->script("DROP ROLE IF EXISTS " + role + "; CREATE ROLE " + role + " LOGIN"));
  {
    auto opened = openPostgres({.url = urlOf(otherName()) + " user=" + role});
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    EngineConnection& other = **opened;
    must(other.script("SELECT pg_advisory_lock(" + std::to_string(kWriterLock) + ")"));
    EXPECT_FALSE(other.script("LOCK TABLE needlelab.schema_version IN ACCESS SHARE MODE").ok());
    const std::string locked =
        "SELECT count(*) FROM pg_locks WHERE relation = 'needlelab.schema_version'::regclass"
        " AND mode = 'ExclusiveLock'";
    must(db->begin(EngineConnection::Begin::kWrite));
    EXPECT_EQ(number(*db, locked), 1);
    must(add(1));
    must(db->commit());
    EXPECT_EQ(number(*db, locked), 0);
  }
  EXPECT_EQ(count(), 1);
  must(control_->script("DROP ROLE " + role));
}

// kDenied would be shown as a wrong password to users logging in at that time.
TEST_F(PostgresEngine, aRevokedConnectRightIsAnOutageOfAnOpenConnection) {
  const std::string role = otherName() + "_role";
  must(control_->script("DROP ROLE IF EXISTS " + role + "; CREATE ROLE " + role + " LOGIN"));
  {
    auto opened = openPostgres({.url = urlOf(otherName()) + " user=" + role});
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    must(control_->script("ALTER ROLE " + role + " NOLOGIN"));
    must(run(*control_,
             "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = '" + role + "'"));
    while (number(*control_, "SELECT count(*) FROM pg_stat_activity WHERE usename = '" + role + "'") > 0)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_FALSE((*opened)->script("SELECT 1").ok());
    const Status again = (*opened)->script("SELECT 1");
    ASSERT_FALSE(again.ok());
    EXPECT_EQ(again.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(again.error().message, HasSubstr("is not permitted to log in"));
    const auto anew = openPostgres({.url = urlOf(otherName()) + " user=" + role});
    ASSERT_FALSE(anew.ok());
    EXPECT_EQ(anew.error().code, ErrorCode::kDenied);
  }
  must(control_->script("DROP ROLE " + role));
}

TEST_F(PostgresEngine, addressesAreCheckedAndShowNoPassword) {
  const auto code = [](const std::string& url, std::string* message) {
    const auto opened = openPostgres({.url = url});
    EXPECT_FALSE(opened.ok()) << url;
    *message = opened ? "" : opened.error().message;
    return opened ? ErrorCode::kFailed : opened.error().code;
  };
  std::string message;
  EXPECT_EQ(code("mysql://anna:secret@host/db", &message), ErrorCode::kInvalidInput);
  EXPECT_THAT(message, Not(HasSubstr("secret")));
  EXPECT_EQ(code("postgresql://anna:secret@127.0.0.1:1/db", &message), ErrorCode::kInvalidInput);
  EXPECT_THAT(message, HasSubstr("passfile"));
  EXPECT_THAT(message, Not(HasSubstr("secret")));
  for (const char* const url :
       {"postgresql://anna:se/secret@127.0.0.1:1/db", "postgresql://anna:secret/db",
        "postgresql://anna:5432/secret@127.0.0.1:1/db", "postgresql://anna@127.0.0.1:1/db?sslpassword=secret",
        "host=127.0.0.1 port=1 user=anna sslpassword=secret", "postgresql://anna@se@secret:1/db"}) {
    EXPECT_EQ(code(url, &message), ErrorCode::kInvalidInput) << url;
    EXPECT_THAT(message, Not(HasSubstr("secret")));
  }
  EXPECT_EQ(code("postgresql://anna@127.0.0.1:1/db", &message), ErrorCode::kUnavailable);
  EXPECT_THAT(message, HasSubstr("postgresql://anna@127.0.0.1:1/db"));
  EXPECT_EQ(code(urlOf("no_such_database"), &message), ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab

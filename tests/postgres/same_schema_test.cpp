// The schema's behaviour on PostgreSQL, equal to SQLite's, and what a start refuses in it. Columns,
// constraints and indexes: same_catalogue_test.cpp.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "db/engine/open_postgres.h"
#include "db/store/connection.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

class SameSchema : public testing::Test {
 protected:
  SameSchema() : cluster_(std::getenv("NEEDLELAB_TEST_POSTGRES")), control_(connect("postgres")) {
    must(control_->script("DROP DATABASE IF EXISTS " + name_));
    must(control_->script("CREATE DATABASE " + name_));
    db = connect(name_);
    must(db->script("CREATE SCHEMA needlelab"));
    for (const EmbeddedFile& file : embeddedPostgresMigrations()) must(db->script(std::string(file.text)));
  }
  ~SameSchema() override {
    db.reset();
    (void)control_->script("DROP DATABASE IF EXISTS " + name_ + " WITH (FORCE)");
  }
  std::unique_ptr<EngineConnection> connect(const std::string& database) const {
    auto opened = openPostgres({.url = cluster_ + " dbname=" + database});
    if (!opened) throw std::runtime_error(opened.error().message);
    return std::move(*opened);
  }
  static void must(const Status& status) {
    if (!status) throw std::runtime_error(status.error().message);
  }
  std::unique_ptr<EngineStatement> asked(const std::string& sql) {
    auto statement = db->prepare(sql);
    if (!statement) throw std::runtime_error(statement.error().message);
    return std::move(*statement);
  }
  std::int64_t number(const std::string& sql) {
    auto statement = asked(sql);
    const auto row = statement->step();
    if (!row) throw std::runtime_error(row.error().message);
    return *row ? statement->integer(0) : -1;
  }

  const std::string cluster_;
  std::unique_ptr<EngineConnection> control_;
  const std::string name_ = "schema" + std::to_string(::getpid());
  std::unique_ptr<EngineConnection> db;
};

TEST_F(SameSchema, whatSomebodyPutIntoItOrChangedIsNamed) {
  Connection connection(connect(name_), "lab");
  const auto faults = [&] {
    auto found = postgresSchemaFaults(connection, kMaxSchemaFaults);
    if (!found) throw std::runtime_error(found.error().message);
    return *found;
  };
  EXPECT_EQ(faults(), std::vector<std::string>())
      << "db/store/postgres_objects.cpp has what the migrations make";
  struct Change {
    const char *sql, *named, *undo;
  };
  const Change changes[] = {
      {"CREATE TRIGGER higher BEFORE INSERT ON people FOR EACH ROW EXECUTE FUNCTION sessions_sum()",
       "trigger 'higher' of 'people' is not needlelab's", "DROP TRIGGER higher ON people"},
      {"CREATE FUNCTION lowered(part TEXT) RETURNS TEXT LANGUAGE sql AS 'SELECT part'",
       "function 'lowered(part text)' is not needlelab's", "DROP FUNCTION lowered(TEXT)"},
      {"CREATE VIEW shown AS SELECT 1", "view 'shown' is not needlelab's", "DROP VIEW shown"},
      {"CREATE RULE silent AS ON INSERT TO audit DO INSTEAD NOTHING",
       "rule 'silent' of 'audit' is not needlelab's", "DROP RULE silent ON audit"},
      {"CREATE POLICY hidden ON audit USING (false)", "row policy 'hidden' of 'audit' is not needlelab's",
       "DROP POLICY hidden ON audit"},
      {"ALTER TABLE sessions DISABLE TRIGGER sessions_ended",
       "trigger 'sessions_ended' of 'sessions' is not as",
       "ALTER TABLE sessions ENABLE TRIGGER sessions_ended"},
      {"ALTER TRIGGER audit_number ON audit RENAME TO other", "trigger 'audit_number' of 'audit' is missing",
       "ALTER TRIGGER other ON audit RENAME TO audit_number"},
      {"CREATE OR REPLACE FUNCTION hex(bytes BYTEA) RETURNS TEXT LANGUAGE sql IMMUTABLE AS $$SELECT '00'$$",
       "function 'hex(bytes bytea)' is not as", nullptr},
  };
  for (const Change& change : changes) {
    must(db->script(change.sql));
    std::string all;
    for (const std::string& fault : faults()) all += fault + "\n";
    EXPECT_NE(all.find(change.named), std::string::npos) << change.named << " is not in: " << all;
    if (change.undo == nullptr) break;
    must(db->script(change.undo));
    EXPECT_EQ(faults(), std::vector<std::string>()) << change.undo;
  }
}

TEST_F(SameSchema, aSchemaOrTableOfAnotherRoleIsRefused) {
  Connection connection(connect(name_), "lab");
  const std::string role = name_ + "_role";
  must(control_->script("DROP ROLE IF EXISTS " + role + "; CREATE ROLE " + role));
  must(requireOwnSchema(connection));
  for (const std::string what : {"SCHEMA needlelab", "TABLE needlelab.people"}) {
    must(db->script("ALTER " + what + " OWNER TO " + role));
    const Status refused = requireOwnSchema(connection);
    ASSERT_FALSE(refused.ok()) << what;
    EXPECT_EQ(refused.error().code, ErrorCode::kDenied);
    EXPECT_NE(refused.error().message.find(role), std::string::npos);
    must(db->script("ALTER " + what + " OWNER TO CURRENT_USER"));
  }
  must(requireOwnSchema(connection));
  must(control_->script("DROP ROLE " + role));
}

TEST_F(SameSchema, textsSortByteByByte) {
  EXPECT_EQ(number("SELECT count(*) FROM information_schema.columns WHERE table_schema = 'needlelab'"
                   " AND data_type = 'text' AND collation_name IS DISTINCT FROM 'C' AND table_name <> "
                   "'uncounted_sessions'"),
            0);
}

TEST_F(SameSchema, keysAreNumberedAsInSqlite) {
  must(db->script(
      "INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1, '', '', '', '');"
      "INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES (10, 1, '', '', '', '');"
      "DELETE FROM audit WHERE id = 10;"
      "INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1, '', '', '', '');"
      "INSERT INTO people (uuid, role, created_unix_ns, changed_unix_ns) VALUES (zeroblob(16), 4, 1, 1);"
      "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES ('@1', 1, 1, '', '');"
      "DELETE FROM consents;"
      "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES ('@1', 1, 1, '', '')"));
  EXPECT_EQ(number("SELECT max(id) FROM audit"), 11) << "a number of the log is never used again";
  EXPECT_EQ(number("SELECT max(id) FROM consents"), 1);
}

TEST_F(SameSchema, theSumsOfAttemptsFollowTheSessions) {
  must(db->script(
      "INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('s', zeroblob(32), 1);"
      "INSERT INTO sessions (id, station, trainee, exercise_id, profile_id, profile_revision, profile_json,"
      " engine_version, rate_hz, started_unix_ns, description, state, received_unix_ns, passed)"
      " VALUES (zeroblob(16), 's', '@1', 'knee', '', 1, '', '', 1000, 1, '', 2, 1, 1);"
      "INSERT INTO people (uuid, role, created_unix_ns, changed_unix_ns) VALUES (zeroblob(16), 0, 1, 1);"
      "INSERT INTO unknown_trainees (session, given) VALUES (1, '@1')"));
  const auto sums = [&] {
    return number(
        "SELECT coalesce(sum(1000 * sessions + 100 * attempts + 10 * counted + passed), 0)::bigint"
        " FROM attempt_sums");
  };
  EXPECT_EQ(sums(), 1111) << "no one has the name";
  must(db->script("UPDATE unknown_trainees SET code_unchecked = 1"));
  EXPECT_EQ(sums(), 1000) << "nobody gave the code: it counts for nobody";
  must(db->script("INSERT INTO unknown_trainees (session, given) VALUES (1, '@1') ON CONFLICT DO NOTHING"));
  EXPECT_EQ(sums(), 1000);
  must(db->script("UPDATE unknown_trainees SET by_whom = 'mia', assigned_unix_ns = 1"));
  EXPECT_EQ(sums(), 1111);
  must(db->script("UPDATE sessions SET excused = 1"));
  EXPECT_EQ(sums(), 1100);
  must(db->script("UPDATE sessions SET erased = 1"));
  EXPECT_EQ(number("SELECT count(*) FROM attempt_sums"), 0);
}

}  // namespace
}  // namespace needlelab

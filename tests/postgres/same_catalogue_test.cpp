// Both engines have the same schema, as far as PostgreSQL can tell: SQLite's catalogue is recreated there,
// and PostgreSQL describes both. And each CHECK refuses on both engines what it is meant to refuse.
#include <gmock/gmock.h>

#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "db/store/schema.h"
#include "tests/support/store/postgres_database.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

/// A schema described by PostgreSQL: columns with type, NULL, default and collation, constraints, indexes.
constexpr const char* kCatalogue = R"sql(
WITH tables AS (SELECT c.oid, c.relname FROM pg_class c JOIN pg_namespace n ON n.oid = c.relnamespace
 WHERE n.nspname = ?1 AND c.relkind = 'r' AND c.relname NOT IN ('last_numbers', 'schema_version'))
SELECT concat_ws(' ', 'column', t.relname, a.attname, format_type(a.atttypid, a.atttypmod),
  CASE WHEN a.attnotnull THEN 'NOT NULL' END, 'DEFAULT ' || pg_get_expr(d.adbin, d.adrelid), 'COLLATE ' || o.collname)
 FROM tables t JOIN pg_attribute a ON a.attrelid = t.oid AND a.attnum > 0 AND NOT a.attisdropped
 LEFT JOIN pg_attrdef d ON d.adrelid = t.oid AND d.adnum = a.attnum LEFT JOIN pg_collation o ON o.oid = a.attcollation
UNION ALL SELECT concat_ws(' ', 'constraint', t.relname, pg_get_constraintdef(k.oid),
  CASE WHEN k.contype = 'f' THEN concat(k.confupdtype, k.confdeltype, k.confmatchtype) END, CASE WHEN k.condeferrable THEN 'DEFERRABLE' END,
  CASE WHEN NOT k.convalidated THEN 'NOT VALID' END)
 FROM tables t JOIN pg_constraint k ON k.conrelid = t.oid
UNION ALL SELECT replace(pg_get_indexdef(i.indexrelid), ?1 || '.', '') FROM tables t JOIN pg_index i ON i.indrelid = t.oid
)sql";

/// A definition from SQLite's catalogue in PostgreSQL's syntax. The last two are sessions_by_verdict, whose
/// expression needs its own parentheses there, and which, like any SQLite index, ends with the row's number.
std::string forPostgresCatalogue(std::string sql) {
  const std::pair<const char*, const char*> replaced[] = {
      {"--[^\n]*", ""},
      {"\\bINTEGER\\b", "BIGINT"},
      {"\\bREAL\\b", "DOUBLE PRECISION"},
      {"\\bBLOB\\b", "BYTEA"},
      {"\\bTEXT\\b", "TEXT COLLATE \"C\""},
      {"\\bAUTOINCREMENT\\b", ""},
      {"\\) STRICT(, WITHOUT ROWID)?$", ")"},
      {"\n  \\(length\\(", "\n  ((length("},
      {" / 13, started_unix_ns\\)", " / 13), started_unix_ns, number)"}};
  for (const auto& [what, by] : replaced) sql = std::regex_replace(sql, std::regex(what), by);
  return sql;
}

class SameCatalogue : public testing::Test {
 protected:
  SameCatalogue() {
    EXPECT_OK(sqlite.script("PRAGMA query_only=OFF; PRAGMA foreign_keys=ON"));
    for (const EmbeddedFile& file : embeddedMigrations()) EXPECT_OK(sqlite.script(std::string(file.text)));
  }
  /// Creates what SQLite's catalogue describes, in the schema `like_sqlite`.
  void makeLikeSqlite() {
    ASSERT_OK(postgres.script("CREATE SCHEMA like_sqlite; SET search_path TO like_sqlite"));
    auto waiting = TestDb::must(
        sqlite
            .prepare("SELECT sql FROM sqlite_schema WHERE type IN ('table', 'index') AND sql IS NOT NULL"
                     " AND name NOT LIKE 'sqlite%'")
            .all(firstText));
    // each after what it refers to
    for (std::size_t before = 0; !waiting.empty() && before != waiting.size();) {
      before = waiting.size();
      std::erase_if(waiting,
                    [&](const std::string& sql) { return postgres.script(forPostgresCatalogue(sql)).ok(); });
    }
    ASSERT_TRUE(waiting.empty()) << waiting.front() << "\n"
                                 << postgres.script(forPostgresCatalogue(waiting.front())).error().message;
  }
  static std::multiset<std::string> catalogueOf(Connection& connection, const std::string& schema) {
    // objects in this schema are written without its name
    EXPECT_OK(connection.script("SET search_path TO " + schema));
    const auto lines = TestDb::must(connection.query(kCatalogue, schema).all(firstText));
    EXPECT_OK(connection.script("SET search_path TO needlelab"));
    return {lines.begin(), lines.end()};
  }

  TempFolder folder;
  PostgresBelow dropped_at_end{folder.path()};
  Connection sqlite =
      TestDb::must(Connection::open(":memory:", {.mode = Connection::Mode::kReader, .create = true}));
  Connection postgres = TestDb::must(openAt(
      StoreAddress(folder.path() / "x", postgresUrlOf(folder.path() / "one")), Connection::Mode::kWriter));
};

TEST_F(SameCatalogue, columnsDefaultsConstraintsAndIndexesAreTheSame) {
  makeLikeSqlite();
  const auto wanted = catalogueOf(postgres, "like_sqlite"), found = catalogueOf(postgres, "needlelab");
  std::map<std::string, int> kinds;
  for (const std::string& line : wanted) {
    ++kinds[line.substr(0, line.find(' '))];
    kinds["CHECK"] += line.find(" CHECK (") != std::string::npos ? 1 : 0;
    kinds["FOREIGN"] += line.find(" FOREIGN KEY (") != std::string::npos ? 1 : 0;
    kinds["UNIQUE"] += line.find("UNIQUE") != std::string::npos ? 1 : 0;
    kinds["DEFAULT"] += line.find(" DEFAULT ") != std::string::npos ? 1 : 0;
  }
  EXPECT_GE(kinds["column"], 200);
  EXPECT_GE(kinds["CHECK"], 60);
  EXPECT_GE(kinds["FOREIGN"], 15);
  EXPECT_GE(kinds["UNIQUE"], 3);
  EXPECT_GE(kinds["DEFAULT"], 20);
  EXPECT_GE(kinds["CREATE"], 40) << "indexes, with those of primary keys";
  for (const std::string& line : wanted)
    EXPECT_EQ(found.count(line), wanted.count(line)) << "SQLite has: " << line;
  for (const std::string& line : found)
    EXPECT_EQ(found.count(line), wanted.count(line)) << "PostgreSQL has: " << line;
}

// --- one row for each CHECK

/// A column's value in valid rows, where it is not 1, 1.0, 'x' or 32 bytes.
const std::map<std::string, std::string> kRightValues = {{"sessions.number", "9"},
                                                         {"sessions.id", "zeroblob(16)"},
                                                         {"sessions.station", "'s'"},
                                                         {"station_claims.station", "'s'"},
                                                         {"assignments.course_id", "'c'"},
                                                         {"assignments.trainee", "'t'"},
                                                         {"audit_chain.key_id", "zeroblob(8)"},
                                                         {"derived_recordings.hash", "zeroblob(32)"},
                                                         {"derived_chunks.session", "2"},
                                                         {"consents.person", "'@1'"},
                                                         {"people.id", "9"},
                                                         {"people.uuid", "zeroblob(16)"},
                                                         {"names.person", "1"},
                                                         {"unknown_trainees.given", "'@1'"},
                                                         {"erasures.uuid", "zeroblob(16)"}};

struct WrongRow {
  const char* table;
  std::map<std::string, std::string> values;  ///< values of these columns that one CHECK refuses
};
const std::vector<WrongRow> kWrongRows = {
    {"people", {{"uuid", "zeroblob(15)"}}},
    {"people", {{"role", "5"}}},
    {"people", {{"disabled", "2"}}},
    {"people", {{"revision", "0"}}},
    {"names", {{"name", "''"}}},
    {"names", {{"typed", "2"}}},
    {"erased_names", {{"hash", "zeroblob(31)"}}},
    {"stations", {{"name", "''"}}},
    {"stations", {{"key_hash", "zeroblob(31)"}}},
    {"stations", {{"revoked", "2"}}},
    {"profiles", {{"revision", "0"}}},
    {"curricula", {{"revision", "0"}}},
    {"sessions", {{"id", "zeroblob(15)"}}},
    {"sessions", {{"state", "4"}}},
    {"sessions", {{"hash", "zeroblob(31)"}}},
    {"sessions", {{"events", "-1"}}},
    {"sessions", {{"recording", "0"}}},
    {"sessions", {{"passed", "2"}}},
    {"sessions", {{"excused", "3"}}},
    {"sessions", {{"erased", "2"}}},
    {"chunks", {{"seq", "-1"}}},
    {"chunks", {{"samples", "0"}}},
    {"session_events", {{"position", "-1"}}},
    {"session_events", {{"kind", "3"}}},
    {"session_events", {{"end_tick", "0"}}},
    {"session_events", {{"begin_layer", "-2"}}},
    {"session_events", {{"end_layer", "-2"}}},
    {"retention_policies", {{"thin_after_days", "36501"}, {"thin_rate_hz", "1"}}},
    {"retention_policies", {{"thin_after_days", "1"}, {"thin_rate_hz", "0"}}},
    {"retention_policies", {{"thin_coarser", "1001"}}},
    {"retention_policies", {{"delete_after_days", "-1"}}},
    {"retention_policies", {{"without_backup", "2"}}},
    {"retention_policies", {{"thin_after_days", "1"}}},
    {"derived_recordings", {{"complete", "2"}}},
    {"derived_recordings", {{"original_hash", "zeroblob(31)"}}},
    {"derived_recordings", {{"hash", "zeroblob(31)"}}},
    {"derived_recordings", {{"hash", "NULL"}}},
    {"derived_chunks", {{"seq", "-1"}}},
    {"derived_chunks", {{"samples", "0"}}},
    {"removed_originals", {{"leftover", "2"}}},
    {"removed_originals", {{"crcs", "zeroblob(31)"}}},
    {"assignments", {{"exercise_id", "'e'"}}},
    {"assignments", {{"group_id", "'g'"}}},
    {"groups", {{"id", "''"}}},
    {"groups", {{"revision", "0"}}},
    {"groups", {{"removed", "2"}}},
    {"consents", {{"given", "2"}}},
    {"scores", {{"definition_version", "0"}}},
    {"scores", {{"passed", "2"}}},
    {"scores", {{"first", "2"}}},
    {"exercise_references", {{"revision", "0"}}},
    {"erasures", {{"uuid", "zeroblob(15)"}}},
    {"session_progress", {{"chunks", "-1"}}},
    {"session_progress", {{"samples", "-1"}}},
    {"session_progress", {{"stored_bytes", "-1"}}},
    {"audit_chain", {{"position", "0"}}},
    {"audit_chain", {{"key_id", "zeroblob(7)"}}},
    {"audit_chain", {{"mac", "zeroblob(31)"}}},
    {"quarantined_chunks", {{"seq", "-1"}}},
    {"unknown_trainees", {{"code_unchecked", "2"}}},
    {"unknown_trainees", {{"begin_unsure", "2"}}},
    {"unknown_trainees", {{"not_assigned", "2"}}},
    {"exercises", {{"assigned_only", "2"}}},
    {"exercises", {{"exam_attempts", "0"}}},
    {"unknown_trainees", {{"by_whom", "'m'"}}},
    {"access_numbers", {{"what", "5"}}},
    {"login_tokens", {{"hash", "zeroblob(31)"}}},
    {"station_claims", {{"epoch", "0"}}},
    {"login_attempts", {{"key", "zeroblob(31)"}}},
    {"noted_reads", {{"key", "zeroblob(31)"}}},
};

class SameChecks : public SameCatalogue {
 protected:
  SameChecks() {
    // the rows that others refer to
    for (Connection* db : {&sqlite, &postgres}) {
      EXPECT_OK(
          db->run("INSERT INTO people (uuid, role, created_unix_ns, changed_unix_ns) VALUES (?, 1, 1, 1)",
                  ByteView(Bytes(16, 7))));
      EXPECT_OK(db->script(
          "INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('s', zeroblob(32), 1);"
          "INSERT INTO audit (id, unix_ns, who, action, subject, detail) VALUES (1, 1, '', '', '', '')"));
      for (std::uint8_t number : {1, 2})
        EXPECT_OK(db->run(
            "INSERT INTO sessions (number, id, station, trainee, exercise_id, profile_id, profile_revision,"
            " profile_json, engine_version, rate_hz, started_unix_ns, description, state, received_unix_ns)"
            " VALUES (?, ?, 's', '', '', '', 1, '', '', 1000, 1, zeroblob(0), 2, 1)",
            static_cast<int>(number), ByteView(Bytes(16, number))));
      EXPECT_OK(
          db->script("INSERT INTO derived_recordings (session, complete, original_hash, method, rate_hz, "
                     "created_unix_ns)"
                     " VALUES (2, 0, zeroblob(32), '', 1, 1)"));
    }
  }
  /// An INSERT of a valid row, except for these values.
  std::string insertOf(const std::string& table, const std::map<std::string, std::string>& but) {
    std::map<std::string, std::string> values;
    auto columns = sqlite.query(
        "SELECT name, type, (\"notnull\" <> 0 OR pk > 0) AND dflt_value IS NULL FROM pragma_table_info(?)",
        table);
    while (*columns.step()) {
      const std::string name = columns.text(0), type = columns.text(1);
      if (columns.integer(2) == 0) continue;
      values[name] = type == "TEXT" ? "'x'" : type == "BLOB" ? "zeroblob(32)" : "1";
    }
    for (const auto& [column, value] : kRightValues)
      if (column.starts_with(table + ".")) values[column.substr(table.size() + 1)] = value;
    for (const auto& [column, value] : but) values[column] = value;
    std::string names, all;
    for (const auto& [name, value] : values) {
      names += (names.empty() ? "" : ", ") + name;
      all += (all.empty() ? "" : ", ") + value;
    }
    return "INSERT INTO " + table + " (" + names + ") VALUES (" + all + ")";
  }
  /// The part of a refusal after `before`, up to `end`.
  static std::string part(const std::string& message, const std::string& before, const std::string& end) {
    const std::size_t at = message.find(before);
    if (at == std::string::npos) return "";
    const std::size_t from = at + before.size();
    return message.substr(from, message.find(end, from) - from);
  }
};

TEST_F(SameChecks, refuseTheSameRows) {
  std::set<std::string> refused_by, of_sqlite;
  for (const WrongRow& row : kWrongRows) {
    const std::string right = insertOf(row.table, {}), wrong = insertOf(row.table, row.values);
    for (Connection* db : {&sqlite, &postgres}) {
      SCOPED_TRACE(wrong);
      {
        const auto undone = Transaction::begin(*db, Transaction::Kind::kWrite);
        ASSERT_OK(undone);
        EXPECT_OK(db->run(right));
      }
      const Status refused = db->run(wrong);
      ASSERT_FALSE(refused.ok());
      EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput) << refused.error().message;
      if (db == &postgres)
        refused_by.insert(part(refused.error().message, "violates check constraint \"", "\""));
      else
        of_sqlite.insert(std::string(row.table) + ": " +
                         part(refused.error().message, "CHECK constraint failed: ", " ("));
    }
  }
  const auto all = TestDb::must(
      postgres
          .prepare("SELECT k.conname::text FROM pg_constraint k JOIN pg_namespace n ON n.oid = k.connamespace"
                   " WHERE n.nspname = 'needlelab' AND k.contype = 'c'")
          .all(firstText));
  EXPECT_EQ(refused_by, std::set<std::string>(all.begin(), all.end()))
      << "a new CHECK wants a row in kWrongRows";
  EXPECT_EQ(kWrongRows.size(), all.size());
  EXPECT_EQ(of_sqlite.size(), all.size());
}

// --- migrations

TEST_F(SameCatalogue, aLaterVersionKeepsTheRowsAndOneThatFailsChangesNothing) {
  std::vector<EmbeddedFile> files(embeddedPostgresMigrations().begin(), embeddedPostgresMigrations().end());
  ASSERT_OK(MetaStore(postgres).set("k", "1"));
  files.push_back({"0002_more.sql", "ALTER TABLE meta ADD COLUMN more BIGINT NOT NULL DEFAULT 7"});
  for (int start = 0; start < 2; ++start) {
    ASSERT_OK(migrate(postgres, files));
    EXPECT_EQ(TestDb::must(schemaVersion(postgres)), 2);
  }
  files.push_back({"0003_bad.sql", "CREATE TABLE b (x BIGINT); CREATE TABLE meta (y BIGINT)"});
  const Status failed = migrate(postgres, files);
  ASSERT_FALSE(failed.ok());
  EXPECT_THAT(failed.error().message, testing::HasSubstr("0003_bad.sql"));
  EXPECT_EQ(TestDb::must(schemaVersion(postgres)), 2);
  auto row = postgres.prepare("SELECT value, more, to_regclass('b') IS NULL FROM meta WHERE key = 'k'");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.text(0), "1");
  EXPECT_EQ(row.integer(1), 7);
  EXPECT_EQ(row.integer(2), 1);
  EXPECT_EQ(migrate(postgres).error().code, ErrorCode::kVersion);
}

}  // namespace
}  // namespace needlelab::test

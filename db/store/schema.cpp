#include "db/store/schema.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <iterator>
#include <map>
#include <string>
#include <utility>

#include "common/base/program.h"
#include "db/store/connection.h"

namespace needlelab {
namespace {

Result<std::int64_t> oneInteger(Connection& connection, std::string_view sql) {
  Statement statement = connection.prepare(sql);
  ASSIGN_OR_RETURN(const bool row, statement.step());
  return row ? statement.integer(0) : 0;
}

/// The number at the start of a migration's name; -1 if it has no number.
int numberOf(std::string_view name) {
  int number = -1;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + 4 ? number : -1;
}

/// The database's name in messages.
std::string nameOf(Connection& connection) {
  return connection.sqlite() != nullptr ? connection.origin().string() : "--store";
}

Error newerError(Connection& connection, int found, int known) {
  return {ErrorCode::kVersion,
          fmt::format("{}: its schema has version {}, this program (needlelab {}) knows versions up to {}: "
                      "use the newer program, or restore a backup",
                      nameOf(connection), found, programVersion(), known)};
}

Error foreignSchemaError(Connection& connection, const std::vector<std::string>& faults) {
  return {ErrorCode::kCorrupt,
          fmt::format("{}: {} ({} such faults). It could change or hide what is stored from then on, "
                      "lines of the audit log, too. If you did it, undo it the same way; else keep a copy "
                      "of the {}, find out who did it, and restore a backup from before",
                      nameOf(connection), faults.front(), faults.size(),
                      connection.sqlite() != nullptr ? "file" : "database")};
}

/// Marks a new file as a needlelab database; refuses another program's file.
Status claim(Connection& connection, int version) {
  ASSIGN_OR_RETURN(const auto id, oneInteger(connection, "PRAGMA application_id"));
  if (id == kApplicationId) return {};
  ASSIGN_OR_RETURN(const auto tables, oneInteger(connection, "SELECT count(*) FROM sqlite_schema"));
  if (id != 0 || version != 0 || tables != 0) {
    return Error{
        ErrorCode::kCorrupt,
        fmt::format("{}: this is a database of another program (application_id {}): choose another folder",
                    connection.origin().string(), id)};
  }
  return connection.script(fmt::format("PRAGMA application_id={}", kApplicationId));
}

/// The definitions in a schema: for each "kind 'name' of 'table'" its SQL without quotation marks and white
/// space, in which SQLite versions may differ when they alter a table. Several with one name are
/// concatenated.
using Definitions = std::map<std::string, std::string>;

Result<Definitions> definitionsOf(Connection& connection) {
  auto rows = connection.prepare("SELECT type, name, tbl_name, coalesce(sql, '') FROM sqlite_schema");
  Definitions all;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return all;
    const std::string kind = rows.text(0), name = rows.text(1), table = rows.text(2);
    std::string sql = rows.text(3);
    std::erase_if(sql, [](char c) { return c == '"' || c == ' ' || c == '\n' || c == '\r' || c == '\t'; });
    all[kind + " '" + name + "'" + (name == table ? "" : " of '" + table + "'")] += sql;
  }
}

/// ANALYZE's tables as SQLite creates them: statistics for its planner and, with STAT4, samples of the
/// indexes, which an erasure removes.
struct Statistics {
  std::string_view what, sql;
};
constexpr Statistics kStatistics[] = {
    {"table 'sqlite_stat1'", "CREATETABLEsqlite_stat1(tbl,idx,stat)"},
    {"table 'sqlite_stat4'", "CREATETABLEsqlite_stat4(tbl,idx,neq,nlt,ndlt,sample)"},
};
bool isStatistics(const Definitions::value_type& definition) {
  return std::any_of(std::begin(kStatistics), std::end(kStatistics), [&](const Statistics& statistics) {
    return definition.first == statistics.what && definition.second == statistics.sql;
  });
}

/// Like schemaFaults(), for a file to which exactly `migrations` were applied.
Result<std::vector<std::string>> faultsAfter(Connection& connection,
                                             std::span<const EmbeddedFile> migrations) {
  ASSIGN_OR_RETURN(auto fresh,
                   Connection::open(":memory:", {.mode = Connection::Mode::kReader, .create = true}));
  RETURN_IF_ERROR(fresh.script("PRAGMA query_only=OFF"));
  for (const EmbeddedFile& file : migrations) RETURN_IF_ERROR(fresh.script(std::string(file.text)));
  ASSIGN_OR_RETURN(const auto right, definitionsOf(fresh));
  ASSIGN_OR_RETURN(const auto found, definitionsOf(connection));
  std::vector<std::string> faults;
  const auto fault = [&](std::string text) {
    if (faults.size() < kMaxSchemaFaults) faults.push_back(std::move(text));
  };
  for (const auto& definition : found) {
    const auto& [what, sql] = definition;
    const auto known = right.find(what);
    if (known == right.end() && isStatistics(definition)) continue;
    if (known == right.end())
      fault("schema: " + what + " is not needlelab's: somebody put it in");
    else if (known->second != sql)
      fault("schema: " + what + " is not as needlelab makes it: somebody changed it");
  }
  for (const auto& [what, sql] : right)
    if (!found.contains(what)) fault("schema: " + what + " is missing: somebody removed it");
  return faults;
}

Status apply(Connection& connection, const EmbeddedFile& file, int version) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  RETURN_IF_ERROR(connection.script(std::string(file.text)));
  RETURN_IF_ERROR(connection.script(fmt::format("PRAGMA user_version={}", version)));
  return transaction.commit();
}

}  // namespace

int newestSchemaVersion() {
  return static_cast<int>(embeddedMigrations().size());
}

Result<int> schemaVersion(Connection& connection) {
  if (connection.sqlite() == nullptr) return postgresSchemaVersion(connection);
  ASSIGN_OR_RETURN(const auto version, oneInteger(connection, "PRAGMA user_version"));
  if (version < 0)
    return Error{ErrorCode::kCorrupt,
                 fmt::format("{}: its header says schema version {}, which no program writes: the file is "
                             "damaged; restore a backup",
                             connection.origin().string(), version)};
  return static_cast<int>(version);
}

Result<std::vector<std::string>> schemaFaults(Connection& connection) {
  ASSIGN_OR_RETURN(const auto found, schemaVersion(connection));
  if (found > newestSchemaVersion()) return newerError(connection, found, newestSchemaVersion());
  if (connection.sqlite() == nullptr)  // older ones are checked when they are migrated
    return found == newestSchemaVersion() ? postgresSchemaFaults(connection, kMaxSchemaFaults)
                                          : std::vector<std::string>();
  return faultsAfter(connection, embeddedMigrations().first(static_cast<std::size_t>(found)));
}

Status migrate(Connection& connection) {
  return migrate(connection,
                 connection.sqlite() != nullptr ? embeddedMigrations() : embeddedPostgresMigrations());
}

Status migrate(Connection& connection, std::span<const EmbeddedFile> migrations) {
  ASSIGN_OR_RETURN(const auto found, schemaVersion(connection));
  const int known = static_cast<int>(migrations.size());
  const bool on_sqlite = connection.sqlite() != nullptr;
  if (on_sqlite) RETURN_IF_ERROR(claim(connection, found));
  if (found > known) return newerError(connection, found, known);
  if (on_sqlite) {
    ASSIGN_OR_RETURN(const auto faults,
                     faultsAfter(connection, migrations.first(static_cast<std::size_t>(found))));
    if (!faults.empty()) return foreignSchemaError(connection, faults);
  } else {
    RETURN_IF_ERROR(requirePostgresForSchema(connection));
  }
  for (int version = found + 1; version <= known; ++version) {
    const EmbeddedFile& file = migrations[static_cast<std::size_t>(version - 1)];
    Status done = Error{ErrorCode::kFailed,
                        fmt::format("its name must begin with the number {} in four digits", version)};
    if (numberOf(file.name) == version)
      done = on_sqlite ? apply(connection, file, version) : applyOnPostgres(connection, file, version);
    if (!done.ok())
      return Error{done.error().code, fmt::format("migration {} failed, the database stays at version {}: {}",
                                                  file.name, version - 1, done.error().message)};
  }
  if (on_sqlite) return {};
  ASSIGN_OR_RETURN(const auto faults, postgresSchemaFaults(connection, kMaxSchemaFaults));
  return faults.empty() ? Status() : Status(foreignSchemaError(connection, faults));
}

Status requireRights(Connection& connection) {
  return connection.sqlite() != nullptr ? Status() : requirePostgresRights(connection);
}

Status requireNewestSchema(Connection& connection) {
  ASSIGN_OR_RETURN(const auto found, schemaVersion(connection));
  if (found > newestSchemaVersion()) return newerError(connection, found, newestSchemaVersion());
  if (found < newestSchemaVersion()) {
    return Error{ErrorCode::kVersion, fmt::format("{}: its schema has version {}, wanted is {}: start "
                                                  "needlelab-server on it once, which migrates it",
                                                  nameOf(connection), found, newestSchemaVersion())};
  }
  return {};
}

Status MetaStore::set(std::string_view key, std::string_view value) {
  return connection_.run(
      "INSERT INTO meta (key, value) VALUES (?,?) ON CONFLICT (key) DO UPDATE SET value = excluded.value",
      key, value);
}

Result<std::optional<std::string>> MetaStore::get(std::string_view key) {
  return connection_.query("SELECT value FROM meta WHERE key = ?", key).first(firstText);
}

Result<bool> LabSettingsStore::codesRequired() {
  return is(kCodesRequiredKey);
}
Status LabSettingsStore::setCodesRequired(bool required) {
  return set(kCodesRequiredKey, required);
}

Result<bool> LabSettingsStore::keepsRecordingsOfErased() {
  return is(kKeepErasedKey);
}
Status LabSettingsStore::setKeepsRecordingsOfErased(bool keeps) {
  return set(kKeepErasedKey, keeps);
}

Result<bool> LabSettingsStore::is(std::string_view key) {
  ASSIGN_OR_RETURN(const auto value, MetaStore(connection_).get(key));
  return value == "1";
}

Status LabSettingsStore::set(std::string_view key, bool value) {
  return MetaStore(connection_).set(key, value ? "1" : "0");
}

}  // namespace needlelab

#include "db/schema.h"

#include <charconv>
#include <string>

#include "db/connection.h"

namespace needlelab {
namespace {

Result<std::int64_t> oneInteger(Connection& connection, std::string_view sql) {
  Statement statement = connection.prepare(sql);
  const auto row = statement.step();
  if (!row) return row.error();
  return *row ? statement.integer(0) : 0;
}

/// The number in front of a migration's name; -1 when there is none.
int numberOf(std::string_view name) {
  int number = -1;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + 4 ? number : -1;
}

Error newerError(const Connection& connection, int found, int known) {
  return {ErrorCode::kVersion, connection.path().string() + ": its schema has version " +
                                   std::to_string(found) +
                                   ", this program (needlelab " NEEDLELAB_VERSION ") knows versions up to " +
                                   std::to_string(known) + ": use the newer program, or restore a backup"};
}

/// A new file gets our mark; a file of another program is refused.
Status claim(Connection& connection, int version) {
  const auto id = oneInteger(connection, "PRAGMA application_id");
  if (!id) return id.error();
  if (*id == kApplicationId) return {};
  const auto tables = oneInteger(connection, "SELECT count(*) FROM sqlite_schema");
  if (!tables) return tables.error();
  if (*id != 0 || version != 0 || *tables != 0) {
    return Error{ErrorCode::kCorrupt, connection.path().string() +
                                          ": this is a database of another program (application_id " +
                                          std::to_string(*id) + "): choose another folder"};
  }
  return connection.script("PRAGMA application_id=" + std::to_string(kApplicationId));
}

}  // namespace

int newestSchemaVersion() {
  return static_cast<int>(embeddedMigrations().size());
}

Result<int> schemaVersion(Connection& connection) {
  const auto version = oneInteger(connection, "PRAGMA user_version");
  if (!version) return version.error();
  return static_cast<int>(*version);
}

Status migrate(Connection& connection) {
  return migrate(connection, embeddedMigrations());
}

Status migrate(Connection& connection, std::span<const EmbeddedFile> migrations) {
  const auto found = schemaVersion(connection);
  if (!found) return found.error();
  const int known = static_cast<int>(migrations.size());
  if (auto done = claim(connection, *found); !done) return done;
  if (*found > known) return newerError(connection, *found, known);

  for (int version = *found + 1; version <= known; ++version) {
    const EmbeddedFile& file = migrations[static_cast<std::size_t>(version - 1)];
    const auto named = [&](const Error& error) {
      return Error{error.code, "migration " + std::string(file.name) +
                                   " failed, the database stays at version " + std::to_string(version - 1) +
                                   ": " + error.message};
    };
    if (numberOf(file.name) != version) {
      return named({ErrorCode::kFailed,
                    "its name must begin with the number " + std::to_string(version) + " in four digits"});
    }
    auto transaction = Transaction::begin(connection, Transaction::Kind::kWrite);
    if (!transaction) return named(transaction.error());
    if (auto done = connection.script(std::string(file.text)); !done) return named(done.error());
    if (auto done = connection.script("PRAGMA user_version=" + std::to_string(version)); !done)
      return named(done.error());
    if (auto done = transaction->commit(); !done) return named(done.error());
  }
  return {};
}

Status requireNewestSchema(Connection& connection) {
  const auto found = schemaVersion(connection);
  if (!found) return found.error();
  if (*found > newestSchemaVersion()) return newerError(connection, *found, newestSchemaVersion());
  if (*found < newestSchemaVersion()) {
    return Error{ErrorCode::kVersion, connection.path().string() + ": its schema has version " +
                                          std::to_string(*found) + ", wanted is " +
                                          std::to_string(newestSchemaVersion()) +
                                          ": start needlelab-server on it once, which migrates it"};
  }
  return {};
}

Status MetaStore::set(std::string_view key, std::string_view value) {
  return connection_.run(
      "INSERT INTO meta (key, value) VALUES (?,?) ON CONFLICT (key) DO UPDATE SET value = excluded.value",
      key, value);
}

Result<std::optional<std::string>> MetaStore::get(std::string_view key) {
  auto row = connection_.query("SELECT value FROM meta WHERE key = ?", key);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return std::optional<std::string>();
  return std::optional(row.text(0));
}

}  // namespace needlelab

/// Databases for tests of what works on both engines. The environment variable NEEDLELAB_TEST_POSTGRES names
/// a cluster (tests/postgres/cluster starts one); without it such tests use SQLite files.
#pragma once

#include <filesystem>
#include <string>

namespace needlelab::test {

/// Whether this process tests on PostgreSQL.
bool onPostgres();

/// The URL of the database for `folder` in this process. At the first call it has the newest schema and no
/// rows: it is new from a template, or a returned one. Removed at the program's end. Throws if the cluster
/// does not answer.
std::string postgresUrlOf(const std::filesystem::path& folder);

/// Returns the databases of `folder` and everything below it: this process's next folders get them, emptied,
/// unless more than rows was changed (schema, privileges, settings); then they are removed. Call it after
/// everything with connections has ended.
void dropPostgresBelow(const std::filesystem::path& folder);

/// Does that in its destructor: declare it before all members with connections.
struct PostgresBelow {
  std::filesystem::path folder;
  ~PostgresBelow() {
    if (onPostgres()) dropPostgresBelow(folder);
  }
};

/// The URL for "host=HOST user=USER dbname=DATABASE", the form in NEEDLELAB_TEST_POSTGRES and
/// postgresUrlOf().
inline std::string urlFormOf(const std::string& address) {
  const auto value = [&](const std::string& name) {
    const auto at = address.find(name + "=") + name.size() + 1;
    return address.substr(at, address.find(' ', at) - at);
  };
  return "postgresql://" + value("user") + "@/" + value("dbname") + "?host=" + value("host");
}

}  // namespace needlelab::test

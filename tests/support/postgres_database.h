/// Databases for tests of what works on both engines. The environment variable NEEDLELAB_TEST_POSTGRES names
/// a cluster (tests/postgres/cluster starts one); without it such tests work on SQLite files.
#pragma once

#include <filesystem>
#include <string>

namespace needlelab::test {

/// Whether this process tests on PostgreSQL.
bool onPostgres();

/// The URL of the database that stands for `folder`'s in this process: with the newest schema and
/// without rows at the first call: a new one from a template, or one that was given back. Removed at the
/// program's end. Throws when the cluster does not answer.
std::string postgresUrlOf(const std::filesystem::path& folder);

/// Gives back the databases of `folder` and of what is below it: the next folders of this process get them,
/// emptied, as long as nobody has changed more than rows (a schema, rights, settings); else they are removed.
/// At the end of what holds their connections.
void dropPostgresBelow(const std::filesystem::path& folder);

/// Does that at its destruction: a member before all that has connections.
struct PostgresBelow {
  std::filesystem::path folder;
  ~PostgresBelow() {
    if (onPostgres()) dropPostgresBelow(folder);
  }
};

}  // namespace needlelab::test

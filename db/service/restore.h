/// A backup put in the place of a database: complete or not at all, and what was there is kept.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>
#include "db/connection.h"

#include "common/base/result.h"

namespace needlelab {

/// One person or station.
struct RestoredAccess {
  std::string name;
  bool station = false;
  std::string text;  ///< "user tom: was disabled since the backup, and can log in again"
};

/// Compares people and stations of the replaced database with those of the restored one: disabled accounts,
/// changed passwords and roles, revoked and renewed keys that are as they were. Tokens are not among them:
/// they live in a server's memory and end with it. Errors: a database that cannot be read.
Result<std::vector<RestoredAccess>> accessValidAgain(Connection& replaced, Connection& restored);

/// As link(2).
using LinkCall = int (*)(const char* from, const char* to);

struct RestoreResult {
  /// The database that was replaced, with its log beside it; empty: there was none.
  std::filesystem::path kept;
  std::uint64_t sessions = 0, chunks = 0;  ///< in the restored one, all of them checked
  int schema = 0;                          ///< of the backup; an older one was migrated
  /// Accesses that were withdrawn since the backup and are valid again: they have to be withdrawn again.
  std::vector<RestoredAccess> valid_again;
  std::string not_compared;  ///< why nobody knows which: the replaced database cannot be read; empty: known
};

/// Copies `from` beside DIR's database, checks *the copy* (structure, every chunk, every hash), and then,
/// under the folder's lock, keeps the old database as needlelab.db.replaced-TIME (with its -wal) and puts the
/// copy in its place, without a -wal or -shm. A crash at any instant leaves the old database or, after the
/// decision was written to DIR/restore.pending, is completed by the next start of anything on DIR. `from` is
/// only read. Accesses that were withdrawn since stand in the audit log of the restored database, and in its
/// meta `access_valid_again` for the server's log. On a disk that refuses hard links the old database is
/// renamed in place of linked. `link`: link(2), or what a test puts in its place. Errors: kUnavailable (a
/// server runs on DIR), kInvalidInput (no such file, or it is DIR's own database), kVersion (newer schema),
/// kCorrupt (it fails its check; nothing was changed), kFailed.
Result<RestoreResult> restoreFrom(const std::filesystem::path& folder, const std::filesystem::path& from,
                                  std::int64_t now_unix_ns, LinkCall link = nullptr);

/// Completes what restoreFrom decided before it was cut off. Under the folder's lock, before the database is
/// opened.
Status finishRestore(const std::filesystem::path& folder, LinkCall link = nullptr);

}  // namespace needlelab

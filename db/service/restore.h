/// Replaces a database by a backup, plain or encrypted: completely or not at all. Keeps the old database.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/service/bootstrap.h"

namespace needlelab {

/// In the data folder: the copy that a restore makes and checks; its decision, with the name that the old
/// database gets.
inline constexpr const char* kRestoringCopy = "needlelab.db.restoring";
inline constexpr const char* kRestorePending = "restore.pending";

/// A person or station with an access that is valid again.
struct RestoredAccess {
  std::string name, ref;  ///< of a station both are its name
  bool station = false;
  std::string text;  ///< "user tom: was disabled since the backup, and can log in again"
};

/// Compares people and stations of the replaced database `kept` with those of the restored one, after its
/// first start, which erases people again: finds accounts that were disabled, passwords and roles that were
/// changed, and keys that were revoked or renewed since the backup, and are back in their earlier state. Adds
/// a line to the audit log for each. Errors: a database cannot be read.
Result<std::vector<RestoredAccess>> noteAccessValidAgain(Store& store, const std::filesystem::path& kept);

struct RestoreResult {
  /// The replaced database, with its log beside it; empty: there was no database.
  std::filesystem::path kept;
  std::uint64_t sessions = 0, chunks = 0;  ///< in the restored database, all of them checked
};

/// Copies `from`, which it only reads, beside DIR's database and checks *the copy* (structure, every chunk,
/// every hash). Then, under the folder's lock, keeps the old database as needlelab.db.replaced-TIME (with its
/// -wal) and puts the copy in its place. A crash at any instant leaves the old database or, once the decision
/// is in DIR/restore.pending, the next start of any program on DIR completes the restore. `key_file`: the key
/// of an encrypted backup; empty: `from` is a plain one. Errors: kUnavailable (a server runs on DIR),
/// kInvalidInput (no such file, or it is DIR's own database; the key is missing, is another one, or is given
/// for a plain backup), kVersion (newer schema or format), kCorrupt (the backup or its copy fails its check,
/// or that list cannot be read or is too long; nothing was changed), kNoRoom (for the copy), kFailed.
Result<RestoreResult> restoreFrom(const std::filesystem::path& folder, const std::filesystem::path& from,
                                  std::int64_t now_unix_ns, const std::filesystem::path& key_file = {});

/// Completes a restore that was interrupted after its decision. Under the folder's lock, before the database
/// is opened.
Status finishRestore(const std::filesystem::path& folder);

}  // namespace needlelab

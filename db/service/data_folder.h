/// Looks at a data folder before a program uses it: what stands in the way of its files, and what an earlier
/// program left that was killed. Private to this folder.
#pragma once

#include <filesystem>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// kInvalidInput when something that is no file stands where this program keeps one: a start would wait for
/// ever for the other end of a pipe. The database and what SQLite puts beside it are Connection::open's.
Status checkOwnFiles(const std::filesystem::path& folder);

/// Removes what a killed program left in the folder: the copy of a restore that was not decided, the plain
/// copy of an encrypted backup, temporary files beside this program's own; here and in its folder `backups`,
/// unfinished copies of backups (partialsIn). Only files of exactly these names, no links; what cannot be
/// removed stays. Returns what was removed, sorted. Under the folder's lock, after finishRestore().
std::vector<std::filesystem::path> removeFolderLeftovers(const std::filesystem::path& folder);

/// Whether the programs keep a file of this name there, or its temporary file: in the data folder `folder`
/// the lock, keys, the list of erasures, heads of the audit log, how far acks have come, and what SQLite puts
/// beside the database, in its `tls` keys and certificates. Only SQLite's have names of people. Databases and
/// their copies are none of them. `path` begins with `folder` as it is written.
bool isOwnFile(const std::filesystem::path& folder, const std::filesystem::path& path);

}  // namespace needlelab

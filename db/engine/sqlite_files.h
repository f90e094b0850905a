/// SQLite's files: non-blocking opening, the system error behind an SQLite error, the log's size. Private to
/// db.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <string>

namespace needlelab {

/// Like sqlite3_open_v2(); `handle` must be closed even after an error. From the first call on, SQLite opens
/// all its files with O_NONBLOCK: checking the name first cannot tell what will be there when it is opened,
/// and opening a pipe waits for its other end, perhaps forever. A pipe then fails as "not a database";
/// regular files are unaffected. Thread: any.
int openDatabaseFile(const std::string& name, sqlite3** handle, int flags, const char* vfs);

/// The file's URI with `immutable`: nothing else belongs to it, and no one changes it. For SQLITE_OPEN_URI.
std::string immutableName(const std::filesystem::path& path);

/// The errno behind an SQLite error if it concerns the disk; else 0. `handle` may be null.
int systemErrorOf(int rc, sqlite3* handle, const std::filesystem::path& path);

/// Size of the log file, from SQLite's own file handle, which is correct for every VFS.
std::uint64_t logBytesOf(sqlite3* handle);

}  // namespace needlelab

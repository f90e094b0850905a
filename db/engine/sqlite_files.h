/// SQLite's files: opening them without waiting for anybody, the system's error behind SQLite's, the log's
/// size. Private to db.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <string>

namespace needlelab {

/// As sqlite3_open_v2(), by which `handle` is to be closed after an error, too. From the first call on SQLite
/// waits for no file that it opens (O_NONBLOCK): a look at the name before it cannot tell what lies there
/// when it is opened, and a pipe waits for its other end, perhaps for ever. A pipe is no database then; on
/// regular files the flag has no effect. Thread: any.
int openDatabaseFile(const std::string& name, sqlite3** handle, int flags, const char* vfs);

/// The file by a name that says: nothing else belongs to it, and nobody changes it. For SQLITE_OPEN_URI.
std::string immutableName(const std::filesystem::path& path);

/// The errno behind SQLite's error, when it concerns the disk; else 0. `handle` may be null.
int systemErrorOf(int rc, sqlite3* handle, const std::filesystem::path& path);

/// Size of the log's file, through SQLite's own file handle, which is correct for every VFS.
std::uint64_t logBytesOf(sqlite3* handle);

}  // namespace needlelab

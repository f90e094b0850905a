/// Erasures after which nobody has looked which files still hold the person: the program was killed before,
/// or a start repeated the erasure. Private to this folder.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// The files of this erasure were looked at (LookAtFiles): takes its note away. In a transaction.
Status noteFilesSeen(Connection& writer, const std::string& pseudonym);

/// At a start, when no erasure is under way: writes a line of the audit log for each erasure that is noted
/// (kFilesUnseenKey), with how many files there may hold the person. It names none of them: a file may be
/// called as the person. Forgets the notes when no such file is left, and the last backup, if there was one,
/// is where it was put: a disk that is not there tells nothing. Lists for some 2 s at most, and reads
/// nothing. Writer's connection, outside a transaction. Errors: the database's.
Status tellUnseenFiles(Connection& writer, std::int64_t now_unix_ns);

/// The same for `check`, with names and times of files: those that were changed last before the erasure, or
/// within a day after it began (a backup may have been under way) but not after the start that found the
/// note. Lists for a minute at most, and until `cancelled` (may be null). Empty: there is no such file.
Result<std::string> unseenFilesText(Connection& reader, std::int64_t now_unix_ns,
                                    const std::atomic<bool>* cancelled);

}  // namespace needlelab

/// Whole files, read with a size limit and written so that nobody ever sees half of one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace needlelab {

/// Reads a whole regular file. Errors: kInvalidInput (missing, not a file, over `max_bytes`), the path in the
/// message.
Result<std::string> readWholeFile(const std::filesystem::path& path, std::size_t max_bytes = 256u << 20);

/// The file that a rename has to replace so that `path` names the new one: the end of symbolic links, or
/// `path` itself. Errors: kInvalidInput when something stands there that no file may take the place of: a
/// folder, a device such as /dev/null, a pipe.
Result<std::filesystem::path> replaceableFile(const std::filesystem::path& path);

/// Writes to a temporary file beside `path`, fsyncs it, renames it over `path`, fsyncs the folder.
/// On any error `path` is as it was and the temporary is gone. `mode` is the file's permission, e.g. 0600 for
/// keys. A device or pipe (/dev/stdout, /dev/null) is written to, not replaced.
Status writeFileAtomically(const std::filesystem::path& path, ByteView bytes, unsigned mode = 0644);

/// fsync of a folder, so that a new directory entry survives a power cut.
Status syncFolder(const std::filesystem::path& folder);

}  // namespace needlelab

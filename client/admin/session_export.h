/// A session's samples to a file, read in parts, written atomically.
#pragma once

#include <filesystem>
#include <string>

#include "admin/backend.h"
#include "admin/output.h"
#include "base/result.h"
#include "base/uuid.h"

namespace needlelab {

/// `format`: "csv" (columns of gesture/sample_csv.h), "json" ({"version", "machine", "session", "rows"}) or
/// "recording" (common/gesture/FORMAT.md). Every chunk is checked, and at the end the hash over all of them
/// against the one that the session was closed with: on any fault there is no file. An open session is
/// exported as far as it is stored.
Status exportSession(Backend& backend, Output& output, const Uuid& session, const std::string& format,
                     const std::filesystem::path& file);

}  // namespace needlelab

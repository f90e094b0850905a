/// Moments from the command line, with their time zone.
#pragma once

#include <cstdint>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// "2026-12-01T18:00Z", "2026-12-01T18:00:30+01:00" as ns since 1970 (UTC). A text without a zone is refused:
/// what a bare time means depends on who reads it. kInvalidInput.
Result<std::int64_t> momentOf(const std::string& field, const std::string& text);

}  // namespace needlelab

/// Where a password comes from: a file or the terminal, never an argument (others could read it in the
/// process list).
#pragma once

#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// The first line of `file`; without a file, asks on the terminal without echo. Errors: kInvalidInput (no
/// such file, empty, longer than 1024 bytes, no terminal to ask on).
Result<std::string> readPassword(const std::filesystem::path& file, const std::string& prompt);

}  // namespace needlelab

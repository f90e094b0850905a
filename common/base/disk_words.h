/// What a person should do about a disk that refuses.
#pragma once

#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// Words to follow an error's message, beginning with "; ", for the errno of a failed call on `path`: which
/// disk it is, how much room it has, what to do. Empty for an errno that says nothing of the disk. Thread:
/// any.
std::string diskAdvice(int error_number, const std::filesystem::path& path);

/// `PATH: cannot WHAT: ` and what errno says, with the advice. Call it before anything else can set errno.
Error systemError(const std::filesystem::path& path, const std::string& what);

}  // namespace needlelab

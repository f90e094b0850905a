/// What the log-in screen remembers from one day to the next: server, CA file, name. Never a password.
#pragma once

#include <filesystem>

#include "client/instructor/model/desk.h"
#include "common/base/result.h"

namespace needlelab {

/// Fills the fields of `form` that the file has; a file that is missing or unreadable changes nothing.
void recallLogin(const std::filesystem::path& file, LoginForm& form);
/// Readable by its owner only. Errors: the disk's.
Status rememberLogin(const std::filesystem::path& file, const LoginForm& form);

}  // namespace needlelab

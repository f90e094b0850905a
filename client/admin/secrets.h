/// Passwords from a file or the terminal, never from an argument: arguments are seen by everybody on the
/// machine.
#pragma once

#include <filesystem>
#include <string>

#include "common/base/result.h"

namespace needlelab {

/// The first line of a file. kInvalidInput: missing, empty, too long.
Result<std::string> passwordFromFile(const std::filesystem::path& file);

/// Asks on the terminal without showing what is typed. kInvalidInput when there is no terminal: says which
/// option to use, `option`.
Result<std::string> passwordFromTerminal(const std::string& prompt, const std::string& option);

/// A new password, asked for twice.
Result<std::string> newPasswordFromTerminal(const std::string& name, const std::string& option);

}  // namespace needlelab

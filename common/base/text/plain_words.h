/// Messages as a page or a window shows them. Programs of the command line show them as they are.
#pragma once

#include <string>
#include <string_view>

namespace needlelab {

/// The message without ids that nobody can read: "this session" for "session 0199…-…", "not found" for
/// NOT_FOUND, nothing for "the peer refused (…): "; numbers with a decimal point keep six significant digits.
std::string plainWords(std::string_view message);

}  // namespace needlelab

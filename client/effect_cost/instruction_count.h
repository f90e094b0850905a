/// How many instructions a function executes, counted by valgrind's callgrind: the same on every run of the
/// same binary, unlike time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Whether `valgrind` is on the PATH.
bool hasValgrind();

/// Marks the end of a part in the counted program: the count starts again at zero. Does nothing else.
void endCountedPart();

/// Runs `command` (program and arguments) under callgrind and gives the instructions executed within calls of
/// `needlelab::step` (what it calls included) between one `endCountedPart` and the next: one number per part.
/// Its output is thrown away. Errors: kUnavailable without valgrind; kFailed with what valgrind said when the
/// program failed or made another number of parts than `parts`.
Result<std::vector<std::uint64_t>> countStepInstructions(const std::vector<std::string>& command,
                                                         std::size_t parts);

/// This program's own path, to run it again.
std::string ownProgram();

}  // namespace needlelab

/// Counts a function's instructions with valgrind's callgrind: the same on every run of the same binary,
/// unlike time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Returns whether `valgrind` is on the PATH.
bool hasValgrind();

/// Marks the end of a part in the counted program: the count restarts at zero. Does nothing else.
void endCountedPart();

/// Runs `command` (program and arguments) under callgrind and returns the number of instructions in calls of
/// `needlelab::step` (including callees) between one `endCountedPart` and the next: one number per part.
/// Discards its output. Errors: kUnavailable without valgrind; kFailed with valgrind's message when the
/// program failed or did not make exactly `parts` parts.
Result<std::vector<std::uint64_t>> countStepInstructions(const std::vector<std::string>& command,
                                                         std::size_t parts);

/// Returns this program's own path, to run it again.
std::string ownProgram();

}  // namespace needlelab

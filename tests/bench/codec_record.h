/// The codec's figures over the recordings of a real hand, recording by recording, with PASS or FAIL
/// (goals: README.md).
#pragma once

#include <filesystem>
#include <string>

namespace needlelab::test {

/// Prints the table and writes it to DIR/<machine>/codec.md when `results` is not empty. Returns the
/// program's exit code: 1 for a missed goal, 2 without recordings or when the file cannot be written.
int recordCodec(const std::filesystem::path& results, const std::string& commit);

}  // namespace needlelab::test

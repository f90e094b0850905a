/// The folder of this machine's benchmark results.
#pragma once

#include <string>

namespace needlelab::test {

/// "AMD EPYC, 2 cores, Linux …" → "amd-epyc-2-cores"
std::string folderName(const std::string& machine);

/// "2026-11-20 11:16 UTC"
std::string nowText();

}  // namespace needlelab::test

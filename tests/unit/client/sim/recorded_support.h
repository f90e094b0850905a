/// Recordings for the tests of the fitted models: real ones if available, and synthetic ones by formula.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "client/sim/accuracy/recorded_data.h"

namespace needlelab::test {

/// NEEDLELAB_DATA, or shared/data beside the source tree.
inline std::filesystem::path recordings() {
  return std::getenv("NEEDLELAB_DATA") != nullptr
             ? recordedDataFolder()
             : std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "../shared/data";
}

/// Skips the test if the recording is missing, and tells how to get it.
#define NEEDLELAB_NEEDS_RECORDING(file) \
  if (!hasRecording(test::recordings(), file)) GTEST_SKIP() << missingRecording(test::recordings(), file)

}  // namespace needlelab::test

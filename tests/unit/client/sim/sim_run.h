/// Runs needlelab-sim in the test's own process, and returns its output.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "client/sim/command.h"

namespace needlelab::test {

inline const std::filesystem::path kSamples = NEEDLELAB_SAMPLES;  ///< the folder of the sample profiles

struct Outcome {
  int code = -1;
  std::string out, err;
};

inline Outcome sim(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "needlelab-sim");
  std::vector<const char*> argv;
  for (const std::string& one : arguments) argv.push_back(one.c_str());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Outcome outcome;
  outcome.code = runSim(static_cast<int>(argv.size()), argv.data());
  std::fflush(stdout);
  outcome.out = testing::internal::GetCapturedStdout();
  outcome.err = testing::internal::GetCapturedStderr();
  return outcome;
}

}  // namespace needlelab::test

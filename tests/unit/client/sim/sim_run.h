/// Runs needlelab-sim in the test's own process and returns its output.
#pragma once

#include <gmock/gmock.h>
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

/// A wrong command line, and what its message must name.
struct Refused {
  std::vector<std::string> arguments, named;
};

/// Expects that `command` refuses each with exit code 2 before it writes anything to standard output.
inline void expectRefused(const std::string& command, const std::vector<Refused>& cases) {
  for (const Refused& one : cases) {
    std::vector<std::string> arguments = {command};
    arguments.insert(arguments.end(), one.arguments.begin(), one.arguments.end());
    const Outcome outcome = sim(arguments);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(outcome.out, "");
    for (const std::string& part : one.named) EXPECT_THAT(outcome.err, testing::HasSubstr(part));
  }
}

}  // namespace needlelab::test

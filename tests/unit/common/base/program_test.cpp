#include "common/base/program.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <thread>

namespace needlelab {
namespace {

/// Ends like a program whose library keeps a thread and has work to do at exit.
[[noreturn]] void endBesideALibrary() {
  std::thread([] {
    for (;;) ::pause();
  }).detach();
  std::atexit([] { ::_exit(99); });
  // the test reads this stream
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
  std::cout << "the summary ";
  std::printf("and its last line");
  endProgram(kExitInvalid);
}

TEST(EndProgramDeathTest, writesOutWhatWaitsAndLeavesTheLibrariesAsTheyAre) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(endBesideALibrary(), testing::ExitedWithCode(kExitInvalid), "the summary and its last line");
}

TEST(Program, theMachinesTextNamesCoresAndSystemOnOneLine) {
  const std::string text = machineText();
  EXPECT_THAT(text, testing::HasSubstr("Linux "));
  EXPECT_THAT(text, testing::ContainsRegex(", [0-9]+ cores, "));
  EXPECT_EQ(text.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace needlelab

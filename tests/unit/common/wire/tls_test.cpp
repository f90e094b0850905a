// TLS at the end of a program.
#include "common/wire/tls.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>

namespace needlelab {
namespace {

constexpr int kStillWorks = 7, kWorksNoMore = 9;

/// Returns whether TLS works: then the missing file is what is wrong.
bool tlsWorks() {
  const auto made = makeClientTls("/nowhere/ca.crt");
  return !made.ok() && made.error().code == ErrorCode::kInvalidInput;
}

/// Xlib calls `exit` when its display is lost. The station's handler, which is older than its first use of
/// TLS, then lets the lesson be sent.
[[noreturn]] void exitWhileALessonIsSent() {
  keepTlsAtExit();
  std::atexit([] { ::_exit(tlsWorks() ? kStillWorks : kWorksNoMore); });
  if (!tlsWorks()) ::_exit(kWorksNoMore);
  std::exit(1);
}

// in a process of its own, which has not used TLS before
TEST(TlsDeathTest, isThereForAThreadThatSendsWhileTheProgramExits) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(exitWhileALessonIsSent(), testing::ExitedWithCode(kStillWorks), "");
}

}  // namespace
}  // namespace needlelab

// Faults in a script, and their messages.
#include "tests/unit/client/instructor/screens/window_lab.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

using ScriptRunnerTest = WindowLab;

TEST_F(ScriptRunnerTest, theFailingLineIsNamed) {
  EXPECT_THAT(script("print hello\nexpect \"no such words\"").error().message,
              HasSubstr("script:2: expect \"no such words\": does not stand there"));
  EXPECT_EQ(printed_, std::vector<std::string>{"hello"});
  EXPECT_THAT(script("timeout 0.2\nwait-station bench-9").error().message, HasSubstr("not so within 0 s"));
  EXPECT_THAT(script("pause").error().message, HasSubstr("open one first"));
  EXPECT_THAT(script("seek 1").error().message, HasSubstr("no session is loaded"));
  EXPECT_THAT(script("latency").error().message, HasSubstr("open one first"));
  lab_->form.password = "wrong";
  EXPECT_THAT(script("login").error().message, HasSubstr("name and password"));
}

TEST_F(ScriptRunnerTest, quitEndsAndWaitingLetsTimeGoBy) {
  const std::int64_t began_ns = steadyNowNs();
  EXPECT_TRUE(script("wait 0.3\nquit\nexpect \"never come to\"").ok());
  EXPECT_GE(steadyNowNs() - began_ns, 290'000'000);
}

TEST_F(ScriptRunnerTest, latencyIsMeasuredAndJudged) {
  BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  const Status done =
      script("login\nwait-station bench-1 lesson\nopen station bench-1\nwait 2\nlatency 100000\nframes");
  ASSERT_TRUE(done.ok()) << done.error().message;
  ASSERT_EQ(printed_.size(), 2u);
  EXPECT_THAT(printed_[0], HasSubstr("capture to screen: p50"));
  EXPECT_THAT(script("latency 0.001").error().message, HasSubstr("p99 is"));
}

}  // namespace
}  // namespace needlelab

// Nobody reads what the station says (Ctrl-S, a pager): it goes on all the same.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <thread>

#include "client/station/run/crash_guard.h"
#include "client/station/run/live_line.h"
#include "tests/support/scenes.h"
#include "tests/unit/client/station/run/fake_loop.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

// a pipe into which not one more byte goes; its writing end waits as a terminal's does
class FullPipe {
 public:
  FullPipe() {
    EXPECT_EQ(::pipe(ends_.data()), 0);
    ::fcntl(ends_[1], F_SETFL, O_NONBLOCK);
    const std::array<char, 4096> filling{};
    while (::write(ends_[1], filling.data(), filling.size()) > 0) {
    }
    while (::write(ends_[1], filling.data(), 1) > 0) {
    }
    ::fcntl(ends_[1], F_SETFL, 0);
  }
  ~FullPipe() {
    for (const int end : ends_) ::close(end);
  }
  [[nodiscard]] int end() const { return ends_[1]; }

 private:
  std::array<int, 2> ends_{-1, -1};
};

// how `child` ended; −1 when it did not within 10 s
int ended(pid_t child) {
  if (child < 0) throw std::runtime_error("cannot fork");  // a signal to -1 would reach everybody
  int status = -1;
  for (int i = 0; i < 1000; ++i) {
    if (::waitpid(child, &status, WNOHANG) == child) return status;
    std::this_thread::sleep_for(10ms);
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, &status, 0);
  return -1;
}

TEST(PausedTerminal, whatIsSaidIsDroppedAndHoldsNobodyUp) {
  const FullPipe full;
  const pid_t child = ::fork();
  if (child == 0) {
    LiveLine line(full.end());
    for (int i = 0; i < 5; ++i) line.say("the fault is over: the force comes back");
    line.show({}, 0);
    ::_exit(7);
  }
  const int status = ended(child);
  ASSERT_NE(status, -1) << "it waits for its reader";
  EXPECT_EQ(WEXITSTATUS(status), 7);
}

TEST(PausedTerminal, aCrashTakesTheForceAwayAllTheSame) {
  const FullPipe full;
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    ::dup2(full.end(), STDERR_FILENO);
    const SceneModel model = *compile(paperOneDof(), 1000);
    FakeDevice device([](std::uint64_t, DeviceReading&) { return DeviceRead::kFresh; });
    SteadyLoopClock clock;
    auto ring = std::make_unique<SampleRing>();
    ServoLoop loop(model, device, clock, *ring, ServoSettings{1000, {}, 0});
    const CrashGuard guard(loop);
    std::thread haptic([&] {
      CrashGuard::thisIsTheHapticThread();
      loop.run();
    });
    std::this_thread::sleep_for(20ms);
    ::raise(SIGSEGV);
    haptic.join();
    ::_exit(0);
  }
  const int status = ended(child);
  ASSERT_NE(status, -1) << "it waits for its reader";
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
}

}  // namespace
}  // namespace needlelab::test

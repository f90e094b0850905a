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
#include <string>
#include <thread>

#include "client/station/run/io/live_line.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/loop/signals.h"
#include "tests/support/patience.h"
#include "tests/support/scenes/scenes.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

class EnterKeyTest : public testing::Test {
 protected:
  EnterKeyTest() { EXPECT_EQ(::pipe(ends_.data()), 0); }
  ~EnterKeyTest() override {
    for (const int end : ends_)
      if (end >= 0) ::close(end);
  }
  void type(const std::string& text) {
    ASSERT_EQ(::write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::array<int, 2> ends_{-1, -1};
};

TEST_F(EnterKeyTest, onlyAWholeLineCountsAndOnlyOnce) {
  EnterKey key(ends_[0]);
  EXPECT_FALSE(key.isTerminal());
  EXPECT_FALSE(key.pressed());
  type("abc");
  EXPECT_FALSE(key.pressed());
  type("\n");
  EXPECT_TRUE(key.pressed());
  EXPECT_FALSE(key.pressed());
  type("\n\n\n");
  EXPECT_TRUE(key.pressed()) << "input typed in haste is one";
  EXPECT_FALSE(key.pressed());
}

TEST_F(EnterKeyTest, anEndOfInputIsNoEnterAndNeverWaits) {
  EnterKey key(ends_[0]);
  type("x\n");
  ::close(ends_[1]);
  ends_[1] = -1;
  EXPECT_TRUE(key.pressed());
  for (int k = 0; k < 1000; ++k) EXPECT_FALSE(key.pressed());
}

TEST_F(EnterKeyTest, aFloodIsReadInBoundedPieces) {
  EnterKey key(ends_[0]);
  ::fcntl(ends_[1], F_SETFL, O_NONBLOCK);
  const std::string much(60'000, '\n');
  ASSERT_GT(::write(ends_[1], much.data(), much.size()), 0);
  EXPECT_TRUE(key.pressed());
}

TEST(EnterKey, nothingToReadFromIsNoEnter) {
  EnterKey nothing(-1);
  EXPECT_FALSE(nothing.pressed());
  const int null = ::open("/dev/null", O_RDONLY);
  EnterKey from_null(null);
  EXPECT_FALSE(from_null.pressed());
  ::close(null);
}

// The station continues even if its output is not read (Ctrl-S, a pager).

// A full pipe; its writing end blocks like a terminal.
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

// Returns the exit status of `child`, or −1 if it hangs.
int ended(pid_t child) {
  if (child < 0) throw std::runtime_error("cannot fork");  // a signal to -1 would reach every process
  int status = -1;
  if (eventually([&] { return ::waitpid(child, &status, WNOHANG) == child; })) return status;
  ::kill(child, SIGKILL);
  ::waitpid(child, &status, 0);
  return -1;
}

TEST(Terminal, pausedOutputIsDroppedAndBlocksNothing) {
  const FullPipe full;
  const pid_t child = ::fork();
  if (child == 0) {
    LiveLine line(full.end());
    for (int i = 0; i < 5; ++i) line.printMessage("the fault is over: the force comes back");
    line.show({}, 0);
    ::_exit(7);
  }
  const int status = ended(child);
  ASSERT_NE(status, -1) << "it waits for its reader";
  EXPECT_EQ(WEXITSTATUS(status), 7);
}

TEST(Terminal, aCrashWhilePausedTakesTheForceAwayAllTheSame) {
  const FullPipe full;
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    ::dup2(full.end(), STDERR_FILENO);
    const SceneModel model = *compile(paperOneDof(), 1000);
    FakeDevice device([](std::uint64_t, DeviceReading&) { return DeviceRead::kFresh; });
    LoopTime clock;
    auto ring = std::make_unique<SampleRing>();
    ServoLoop loop(model, device, clock, *ring, ServoSettings{1000, {}, 0});
    const CrashGuard guard(loop);
    std::thread haptic([&] {
      CrashGuard::setHapticThread();
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

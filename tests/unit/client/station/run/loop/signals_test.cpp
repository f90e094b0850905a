#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>
#include <thread>

#include "client/device/device.h"
#include "client/station/run/loop/signals.h"
#include "tests/support/sanitized.h"
#include "tests/support/scenes/scenes.h"
#include "tests/unit/client/station/run/loop/fake_loop.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

// Tests a real crash of another part of the program: a child process with a loop, a device in shared memory,
// and a "view" that crashes.

constexpr double kGuardRate_hz = 1000;

// The parent's view of the child.
struct Seen {
  static constexpr std::size_t kMost = 60'000;
  std::atomic<std::size_t> writes{0};
  std::atomic<std::size_t> crashed_at{0};  // writes so far
  std::atomic<bool> outlived{false};
  std::atomic<std::uint64_t> missed{0};  // ticks
  double force_N[kMost] = {};
};

struct SharedSeen {
  SharedSeen() {
    void* memory = ::mmap(nullptr, sizeof(Seen), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    seen = memory == MAP_FAILED ? nullptr : new (memory) Seen;
  }
  ~SharedSeen() { ::munmap(seen, sizeof(Seen)); }
  Seen* seen;
};

// Simulated time for a loop beside real threads: every tick is exactly on time, however busy the machine is.
// A short sleep between ticks lets the other threads run.
class PacedTime final : public FakeTime {
 public:
  void sleepUntilNs(std::int64_t due_ns) noexcept override {
    FakeTime::sleepUntilNs(due_ns);
    const timespec pause{0, 50'000};
    ::nanosleep(&pause, nullptr);
  }
};

// slides in at 10 mm/s: 1 N from 2 mm on
class ChildDevice final : public Device {
 public:
  explicit ChildDevice(Seen& seen) : seen_(seen) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  Status open(double) override { return {}; }
  DeviceRead read(DeviceReading& reading) noexcept override {
    reading.X_WH = {{0, 0, 1e-3 - 1e-5 * static_cast<double>(++tick_)}, {1, 0, 0, 0}};
    return DeviceRead::kFresh;
  }
  void write(const GuardedWrench& wrench) noexcept override {
    const std::size_t n = seen_.writes.load();
    if (n >= Seen::kMost) return;
    seen_.force_N[n] = wrench.wrench().force_N.z;
    seen_.writes.store(n + 1);
  }
  std::uint64_t skip(std::uint64_t ticks) noexcept override {
    tick_ += ticks;
    seen_.missed += ticks;
    return ticks;
  }
  void close() noexcept override {}

 private:
  DeviceInfo info_{"child", {}, true, true, true};
  Seen& seen_;
  std::uint64_t tick_ = 0;
};

// on an inaccessible page
void segfault() {
  auto* page =
      static_cast<volatile int*>(::mmap(nullptr, 4096, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
  *page = 1;
}

// a recursion that no optimiser can turn into a loop
int deeper(volatile int* depth) {
  volatile char frame[4096];
  frame[0] = static_cast<char>(*depth);
  *depth = *depth + 1;
  if (*depth < 0) return 0;  // never: the stack overflows long before
  return deeper(depth) + frame[0];
}

// a crashing child writes no core file and nothing to the test's log
void leaveNoTrace() {
  const rlimit none{0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
  if (::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(99);
}

// the child's whole life: the loop on simulated time, and `die` on another thread once there is force
[[noreturn]] void live(Seen& seen, const std::function<void()>& die, bool on_main_thread) {
  leaveNoTrace();
  SceneSpec spec = paperOneDof();
  spec.effects = bitOf(Effect::kCutting);
  const SceneModel model = *compile(spec, kGuardRate_hz);
  ChildDevice device(seen);
  PacedTime clock;
  auto ring = std::make_unique<SampleRing>();
  ServoLoop loop(model, device, clock, *ring, ServoSettings{kGuardRate_hz, {}, Seen::kMost});
  const CrashGuard guard(loop);
  std::thread haptic([&] {
    CrashGuard::setHapticThread();
    loop.run();
  });
  const auto view = [&] {
    std::size_t writes = 0;
    for (; writes < 450; writes = seen.writes.load()) std::this_thread::sleep_for(1ms);
    seen.crashed_at.store(writes);
    die();
    seen.outlived.store(true);
  };
  if (on_main_thread) {
    view();
  } else {
    std::thread(view).join();
  }
  haptic.join();
  ::_exit(0);
}

// returns how the child ended
int runChild(Seen& seen, const std::function<void()>& die, bool on_main_thread = false) {
  const pid_t child = ::fork();
  if (child == 0) live(seen, die, on_main_thread);
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return status;
}

void expectRampToZero(const Seen& seen) {
  const std::size_t crash = seen.crashed_at.load(), last = seen.writes.load();
  ASSERT_GE(crash, 450u);
  const double before_N = seen.force_N[crash - 1];
  ASSERT_GT(before_N, 0.9) << "there was a force to take away";
  // the loop continues until the crashed thread has notified it
  std::size_t begin = crash;
  while (begin < last && seen.force_N[begin] > 0.97 * before_N) ++begin;
  ASSERT_LE(begin + 20, last) << "the force never fell, or not for long enough";
  for (std::size_t n = 0; n < 20; ++n)
    EXPECT_NEAR(seen.force_N[begin + n], seen.force_N[begin - 1] * (1 - static_cast<double>(n + 1) / 20),
                1e-9)
        << n;
  for (std::size_t n = begin + 19; n < last; ++n) EXPECT_EQ(seen.force_N[n], 0) << n - begin;
  EXPECT_LE(last - begin, 22u) << "the loop ends with its ramp";
  EXPECT_EQ(seen.missed.load(), 0u);
  EXPECT_FALSE(seen.outlived.load());
}

TEST(CrashGuard, aCrashingViewLeavesZeroForceAndTheSignalAsExit) {
  const std::pair<int, std::function<void()>> deaths[] = {
      {SIGSEGV, segfault},
      {SIGBUS, [] { ::raise(SIGBUS); }},
      {SIGFPE, [] { ::raise(SIGFPE); }},
      {SIGILL, [] { ::raise(SIGILL); }},
      {SIGABRT, [] { std::abort(); }},
      {SIGABRT, [] { throw std::runtime_error("no one catches this"); }},
  };
  for (const auto& [signal, die] : deaths) {
    const SharedSeen shared;
    const int status = runChild(*shared.seen, die);
    EXPECT_TRUE(WIFSIGNALED(status)) << status;
    EXPECT_EQ(WTERMSIG(status), signal);
    expectRampToZero(*shared.seen);
  }
}

TEST(CrashGuard, theThreadThatMadeItMayEvenRunOutOfItsStack) {
  if (kSanitized) GTEST_SKIP() << "a sanitizer ends this by its own means";
  const SharedSeen shared;
  const int status = runChild(
      *shared.seen,
      [] {
        volatile int depth = 0;
        deeper(&depth);
      },
      true);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
  expectRampToZero(*shared.seen);
}

TEST(CrashGuard, twoCrashesAtOnceAreOne) {
  const SharedSeen shared;
  const int status = runChild(*shared.seen, [] {
    std::thread other(segfault);
    segfault();
    other.join();
  });
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
  expectRampToZero(*shared.seen);
}

TEST(CrashGuard, aCrashOfTheHapticThreadItselfIsNotWaitedFor) {
  const SharedSeen shared;
  const pid_t child = ::fork();
  if (child == 0) {
    leaveNoTrace();
    const SceneModel model = *compile(paperOneDof(), kGuardRate_hz);
    FakeDevice device([](std::uint64_t tick, DeviceReading& reading) {
      if (tick >= 50) ::raise(SIGSEGV);  // that tick itself may be missed
      return goingDown(0.01, kGuardRate_hz)(tick, reading);
    });
    LoopTime clock;
    auto ring = std::make_unique<SampleRing>();
    ServoLoop loop(model, device, clock, *ring, ServoSettings{kGuardRate_hz, {}, 20'000});
    const CrashGuard guard(loop);
    std::thread([&] {
      CrashGuard::setHapticThread();
      loop.run();
    }).join();
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
}

// Where a device's last command goes.
struct WordPipe {
  WordPipe() { EXPECT_EQ(::pipe2(ends, O_NONBLOCK | O_CLOEXEC), 0); }
  ~WordPipe() {
    ::close(ends[0]);
    ::close(ends[1]);
  }
  static bool say(int file) noexcept { return ::write(file, "0", 1) == 1; }
  [[nodiscard]] std::string said() const {
    std::array<char, 16> text{};
    const ssize_t got = ::read(ends[0], text.data(), text.size());
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(0, got))};
  }
  int ends[2] = {-1, -1};
};

TEST(CrashGuard, theHandlerReleasesADeviceWhoseOwnThreadCrashes) {
  const SharedSeen shared;
  const WordPipe words;
  const int status = runChild(*shared.seen, [&] {
    registerCrashPacket(&WordPipe::say, words.ends[1]);
    segfault();
  });
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
  EXPECT_EQ(words.said(), "0");
}

TEST(CrashGuard, aLiveThreadsDeviceIsReleasedByLoopThenHandler) {
  const SharedSeen shared;
  const WordPipe words;
  const int status = runChild(*shared.seen, [&] {
    std::thread([&] { registerCrashPacket(&WordPipe::say, words.ends[1]); }).join();
    segfault();
  });
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
  expectRampToZero(*shared.seen);
  EXPECT_EQ(words.said(), "0");
}

TEST(CrashGuard, aReleasedDeviceGetsNoCommand) {
  const SharedSeen shared;
  const WordPipe words;
  const int status = runChild(*shared.seen, [&] {
    registerCrashPacket(&WordPipe::say, words.ends[1]);
    unregisterCrashPacket();
    segfault();
  });
  EXPECT_EQ(WTERMSIG(status), SIGSEGV);
  expectRampToZero(*shared.seen);
  EXPECT_EQ(words.said(), "");
}

TEST(CrashGuard, aHangingLoopBlocksNothing) {
  const pid_t child = ::fork();
  if (child == 0) {
    leaveNoTrace();
    const SceneModel model = *compile(paperOneDof(), kGuardRate_hz);
    FakeDevice device(goingDown(0.01, kGuardRate_hz));
    FakeTime clock;
    auto ring = std::make_unique<SampleRing>();
    ServoLoop loop(model, device, clock, *ring, ServoSettings{kGuardRate_hz, {}, 100});
    const CrashGuard guard(loop);  // no thread runs it
    std::abort();
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGABRT);
}

TEST(CrashGuard, afterwardsSignalHandlersAreRestored) {
  struct sigaction before {
  }, during{}, after{};
  ::sigaction(SIGSEGV, nullptr, &before);
  {
    const SceneModel model = *compile(paperOneDof(), kGuardRate_hz);
    FakeDevice device(goingDown(0.01, kGuardRate_hz));
    FakeTime clock;
    auto ring = std::make_unique<SampleRing>();
    ServoLoop loop(model, device, clock, *ring, ServoSettings{kGuardRate_hz, {}, 100});
    const CrashGuard guard(loop);
    ::sigaction(SIGSEGV, nullptr, &during);
  }
  ::sigaction(SIGSEGV, nullptr, &after);
  EXPECT_NE(during.sa_handler, before.sa_handler);
  EXPECT_EQ(after.sa_handler, before.sa_handler);
}

// Signals that would end or stop the program at once and leave the device's last force on; each in a child
// process.

// Sends `signal` to a program from outside. Returns the signal that it received (0: none), -1 if it died, or
// -2 if it stopped.
int told(int signal, void (*before)(int) = SIG_DFL) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(signal, before);  // independent of the parent's setting
    const sigset_t stop = blockStopSignals();
    // as everywhere in the station: the receiving thread is not the waiting thread
    std::thread([signal] { ::kill(::getpid(), signal); }).join();
    ::_exit(signalWithin(stop, 0ms));
  }
  int status = 0;
  ::waitpid(child, &status, WUNTRACED);
  const bool stopped = WIFSTOPPED(status);
  if (stopped) {
    ::kill(child, SIGKILL);
    ::waitpid(child, &status, 0);
    return -2;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Signals, lessonEndingSignalsAreReportedAndKillNothing) {
  EXPECT_EQ(told(SIGINT), SIGINT);
  EXPECT_EQ(told(SIGTERM), SIGTERM);
  EXPECT_EQ(told(SIGHUP), SIGHUP) << "its terminal was closed";
  EXPECT_EQ(told(SIGQUIT), SIGQUIT);
}

TEST(Signals, whatAnotherProgramOrTheTerminalDoesEndsOrStopsNothing) {
  EXPECT_EQ(told(SIGPIPE), 0) << "the program that read its words is gone";
  EXPECT_EQ(told(SIGXFSZ), 0) << "ulimit -f: the writer gets an error";
  EXPECT_EQ(told(SIGTSTP), 0) << "Ctrl-Z";
  EXPECT_EQ(told(SIGTTOU), 0);
  EXPECT_EQ(told(SIGTTIN), 0);
}

TEST(Signals, whatNohupIgnoresStaysIgnored) {
  EXPECT_EQ(told(SIGHUP, SIG_IGN), 0);
  EXPECT_EQ(told(SIGQUIT, SIG_IGN), 0);
}

TEST(Signals, anAcknowledgementIsNoStop) {
  EXPECT_EQ(told(SIGUSR1), 0);
}

}  // namespace
}  // namespace needlelab::test

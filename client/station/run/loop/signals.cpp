#include "client/station/run/loop/signals.h"

#include <poll.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "client/device/device.h"

namespace needlelab {
namespace {

pthread_t main_thread;

// Runs in threads that a library started before `main` (as OpenBLAS does). They block no signals, so the
// kernel may choose one of them, and the default action would kill the program while the device renders a
// force.
void handOver(int signal) {
  ::pthread_kill(main_thread, signal);
}

constexpr std::array kCrashSignals = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
constexpr int kLoopEndWait_ms = 200;
constexpr int kDeviceWatchdog_ms = 50;  // a device with its own thread notices the missing loop after 20 ms
constexpr int kLastPacket_ms = 400;     // enough for that thread to send "no force" even on a busy machine
constexpr std::size_t kHandlerStackBytes = 64 * 1024;

// all data that the handler reads
std::atomic<ServoLoop*> guarded_loop{nullptr};
std::atomic<TimeSource*> handler_time{nullptr};
std::atomic<pid_t> haptic_thread{0};
static_assert(std::atomic<ServoLoop*>::is_always_lock_free && std::atomic<TimeSource*>::is_always_lock_free &&
              std::atomic<pid_t>::is_always_lock_free);

std::array<struct sigaction, kCrashSignals.size()> actions_before;
stack_t stack_before;
alignas(16) std::array<std::byte, kHandlerStackBytes> handler_stack;

pid_t thisThread() noexcept {
  return static_cast<pid_t>(::syscall(SYS_gettid));
}

// a handler may only use write(2) for messages; a paused terminal (Ctrl-S) must not block it
void writeMessage(const char* text) noexcept {
  pollfd ready{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&ready, 1, 0) != 1 || (ready.revents & POLLOUT) == 0) return;
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, text, std::strlen(text));
}

void pauseMs(std::int64_t ms) noexcept {
  handler_time.load(std::memory_order_acquire)->sleepForNs(ms * 1'000'000);
}

// runs in the crashed thread; async-signal-safe
void onCrash(int signal) {
  ServoLoop* loop = guarded_loop.load(std::memory_order_acquire);
  if (loop != nullptr && thisThread() == crashPacketThread()) {
    // the thread that sends the loop's wrenches is dead
    const bool sent = sendCrashPacket();
    loop->crashStop();
    writeMessage(
        sent ? "station: the device's own thread crashed; zero force was sent to the device\n"
             : "station: the device's own thread crashed and the device cannot be told; its own watchdog has "
               "to take the force away\n");
  } else if (loop != nullptr && thisThread() == haptic_thread.load(std::memory_order_acquire)) {
    writeMessage(
        "station: the haptic thread itself crashed; the device's own watchdog takes the force away\n");
    pauseMs(kDeviceWatchdog_ms);
    sendCrashPacket();
  } else if (loop != nullptr) {
    loop->crashStop();
    writeMessage("station: a part of the program crashed; taking the force away\n");
    for (int ms = 0; ms < kLoopEndWait_ms && !loop->ended(); ++ms) pauseMs(1);
    if (!loop->ended())
      writeMessage("station: the haptic loop did not answer; the device's own watchdog has to\n");
    // a device with its own thread still has to send the loop's zero force
    pauseMs(kLastPacket_ms);
    // that thread may block on a lock that this one holds
    sendCrashPacket();
  }
  // die by the same signal, with its default action
  struct sigaction by_default {};
  by_default.sa_handler = SIG_DFL;
  ::sigaction(signal, &by_default, nullptr);
  sigset_t only_this;
  ::sigemptyset(&only_this);
  ::sigaddset(&only_this, signal);
  ::raise(signal);
  ::pthread_sigmask(SIG_UNBLOCK, &only_this, nullptr);
}

}  // namespace

sigset_t blockStopSignals() {
  main_thread = ::pthread_self();
  sigset_t stop;
  ::sigemptyset(&stop);
  for (const int signal : {SIGINT, SIGTERM}) ::sigaddset(&stop, signal);
  // keeps signals ignored that nohup or a shell ignores
  for (const int signal : {SIGHUP, SIGQUIT}) {
    struct sigaction now {};
    if (::sigaction(signal, nullptr, &now) == 0 && now.sa_handler != SIG_IGN) ::sigaddset(&stop, signal);
  }
  sigset_t blocked = stop;
  ::sigaddset(&blocked, SIGUSR1);
  struct sigaction action {};
  action.sa_handler = handOver;
  action.sa_flags = SA_RESTART;
  ::sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1})
    if (::sigismember(&blocked, signal) == 1) ::sigaction(signal, &action, nullptr);
  ::pthread_sigmask(SIG_BLOCK, &blocked, nullptr);
  // A closed pipe, a file beyond the shell's size limit (both also return errors) and Ctrl-Z must not end or
  // suspend the program at once, because the device would keep its last force.
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGTSTP, SIGTTIN, SIGTTOU}) ::signal(signal, SIG_IGN);
  return stop;
}

int signalWithin(const sigset_t& signals, std::chrono::milliseconds time, TimeSource& clock) {
  return clock.waitForSignalUntilNs(signals, clock.nowNs() + std::chrono::nanoseconds(time).count());
}

CrashGuard::CrashGuard(ServoLoop& loop, TimeSource& time) {
  haptic_thread.store(0, std::memory_order_release);
  handler_time.store(&time, std::memory_order_release);
  guarded_loop.store(&loop, std::memory_order_release);
  // a separate stack for the handler, so that it also works after a stack overflow of this thread
  stack_t stack{};
  stack.ss_sp = handler_stack.data();
  stack.ss_size = handler_stack.size();
  ::sigaltstack(&stack, &stack_before);
  struct sigaction action {};
  action.sa_handler = onCrash;
  action.sa_flags = SA_ONSTACK;
  ::sigemptyset(&action.sa_mask);
  for (std::size_t i = 0; i < kCrashSignals.size(); ++i)
    ::sigaction(kCrashSignals[i], &action, &actions_before[i]);
}

CrashGuard::~CrashGuard() {
  for (std::size_t i = 0; i < kCrashSignals.size(); ++i)
    ::sigaction(kCrashSignals[i], &actions_before[i], nullptr);
  ::sigaltstack(&stack_before, nullptr);
  guarded_loop.store(nullptr, std::memory_order_release);
}

void CrashGuard::setHapticThread() noexcept {
  haptic_thread.store(thisThread(), std::memory_order_release);
}

}  // namespace needlelab
